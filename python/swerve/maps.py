"""The lanes of a scenario's road or map: `self.map` of an operator, or from `swerve.read_map`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import _swerve
from ._files import FileOrDict, checked_file


class Place(NamedTuple):
    """A position along a lane."""

    lane: int
    s_m: float
    """Arc length along the centre line, metres."""
    d_m: float
    """Distance from the centre line, positive to the left, metres."""


class Neighbour(NamedTuple):
    """A lane that shares a border with another one."""

    lane: int
    opposite: bool
    """True if it runs in the opposite direction."""


@dataclass(frozen=True, slots=True, eq=False)
class Lane:
    """A lane in the direction of travel. The arrays have an entry for each bend of the centre line or of a border."""

    id: int
    kind: str
    """`driving`, `shoulder`, `cycling`, `walking` or `parking`."""
    s_m: NDArray[np.float64]
    """Arc lengths along the centre line, metres."""
    x_m: NDArray[np.float64]
    y_m: NDArray[np.float64]
    heading_rad: NDArray[np.float64]
    left_m: NDArray[np.float64]
    """Distances from the centre line to the left border, metres."""
    right_m: NDArray[np.float64]
    """Distances to the right border, positive to the right, metres."""
    speed_limit_mps: float | None
    in_junction: bool
    left: Neighbour | None
    right: Neighbour | None
    successors: list[int]
    predecessors: list[int]


_ARRAYS = ("s_m", "x_m", "y_m", "heading_rad", "left_m", "right_m")


class Map(Mapping[int, Lane]):
    """Lanes by their identities, in order."""

    def __init__(self, lanes: _swerve.Lanes) -> None:
        self._lanes = lanes
        self._ids = dict.fromkeys(lanes.ids())
        self._known: dict[int, Lane] = {}

    def __getitem__(self, lane: int) -> Lane:
        if lane not in self._known:
            self._known[lane] = _lane(lane, self._lanes.lane(lane))
        return self._known[lane]

    def __iter__(self) -> Iterator[int]:
        return iter(self._ids)

    def __len__(self) -> int:
        return len(self._ids)

    def __contains__(self, lane: object) -> bool:
        return lane in self._ids

    def at(self, x_m: float, y_m: float) -> list[Place]:
        """Lanes that contain a point: several where lanes cross, merge or share a border."""
        return [Place(*place) for place in self._lanes.at(x_m, y_m)]

    def nearest(self, x_m: float, y_m: float) -> Place:
        """Lane with the nearest centre line to a point, at any distance."""
        place = self._lanes.nearest(x_m, y_m)
        if place is None:
            raise ValueError("the map has no lanes")
        return Place(*place)


def _lane(id: int, fields: dict[str, Any]) -> Lane:
    for name in _ARRAYS:
        fields[name] = np.frombuffer(fields[name], dtype="<f8")
    for name in ("left", "right"):
        fields[name] = fields[name] and Neighbour(*fields[name])
    return Lane(id, **fields)


def read_map(scenario: FileOrDict) -> Map:
    """The lanes of a scenario: a file, a name or a dictionary."""
    checked_file("scenario", scenario)
    return Map(_swerve.Lanes(scenario))
