"""Facts of a drive, which classes in Python get before their first step."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

from .algorithms import Limits, Route, Shape
from .maps import Map
from .messages import Pose2


@dataclass(frozen=True)
class Start:
    """Facts of a drive. Frames are right-handed: x forward, y to the left, metres, radians."""

    seed: int
    """Seed of the run."""
    scenario: str = field(repr=False)
    """Text of the scenario, TOML."""
    route: Route = field(repr=False)
    """First route of the ego."""
    map: Map = field(repr=False)
    """Lanes of the road or map; those of the route are in it."""
    pose: Pose2
    """Start of the ego: the centre of its rear axle, in the frame of the map."""
    speed_mps: float
    """Speed of the ego at the start."""
    target_speed_mps: float
    """Target speed on a free road."""
    end_m: float
    """Goal: the drive ends when the centre of the ego's outline is at this arc length of the route, metres."""
    timeout_s: float
    """Longest duration of the drive, seconds."""
    shape: Shape
    """Outline of the ego."""
    limits: Limits
    """Limits of the ego."""
    step_ns: int
    """Step of the world (`sim.dt_ms`), nanoseconds."""
    keys: Mapping[str, Any]
    """Keys of `[process.NAME.keys]`, as configured."""

    def read_keys(self, **defaults: Any) -> SimpleNamespace:
        """The keys with these defaults, as attributes.

        Raises ValueError for a key without a default, and for a value that is not of the default's type.
        """
        read = dict(defaults)
        for name, value in self.keys.items():
            if name not in defaults:
                near = difflib.get_close_matches(name, defaults, 1)
                hint = f"; did you mean `{near[0]}`?" if near else ""
                raise ValueError(f"keys: unknown key `{name}`, expected one of {', '.join(defaults) or 'none'}{hint}")
            read[name] = _as(name, value, defaults[name])
        return SimpleNamespace(**read)


def _as(name: str, value: Any, default: Any) -> Any:
    """A value if it is of the type of its default; whole numbers are numbers, too."""
    kind = type(default)
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if default is not None and type(value) is not kind:
        raise ValueError(f"keys.{name}: expected a value of type {kind.__name__}, found {value!r}")
    return value


def start_of(plain: dict[str, Any], lanes: Map) -> Start:
    """The facts, from plain fields and the lanes."""
    messages: dict[str, Any] = {"route": Route, "pose": Pose2, "shape": Shape, "limits": Limits}
    fields = {name: messages[name].from_plain(value) if name in messages else value for name, value in plain.items()}
    return Start(map=lanes, **fields)
