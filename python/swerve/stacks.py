"""The stack as a guest in a foreign world, which feeds its sensors and applies its commands."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _swerve, messages
from ._files import FileOrDict, checked_file, checked_names, checked_threads
from .messages import Command, EgoState, EndReason, Obstacle, ObstacleList, Signal
from .runs import Result
from .streams import message_class, streams_of


@dataclass(frozen=True)
class Input:
    """A stream that a foreign world feeds."""

    message_type: type[messages.Message]
    """Class of its messages."""
    doc: str
    """Meaning of its messages."""
    readers: list[str]
    """Operators of the stack that read it; empty if it is only for the log and the metrics."""
    latency_s: float
    """Time from the stamp of a message to its publication, as configured for a camera, radar or lidar."""


@dataclass(frozen=True)
class Commanded:
    """A command, with its times."""

    at: int
    """Instant from which it is visible to the vehicle, nanoseconds."""
    origin: int | None
    """Stamp of the newest sensor frame that it derives from, nanoseconds."""
    command: Command
    """Steering angle, throttle and brake."""


def _known(type_name: str) -> type[messages.Message]:
    found = getattr(messages, type_name, None)
    return found if isinstance(found, type) and issubclass(found, messages.Message) else messages.Message


class Stack:
    """The stack of a configuration, stepped by a foreign world.

        with swerve.Stack("my.toml", route=points, speed_mps=12.0, log="drive.mcap") as stack:
            while not done:
                stack.feed("pose", pose)            # or stack.feed_scene(ego, obstacles)
                stack.feed("obstacles", obstacles)
                command = stack.advance_to(t_s)     # run times of the stack included
        stack.result.verdict

    The way of the ego is one of three. `route` is a line of points (x, y) in the world's frame: the centre of a lane
    `lane_width_m` wide, with `lanes_left` and `lanes_right` more of the same width and direction; `speed_mps` is the target
    speed, 10 m/s by default. `map` is a file (OpenDRIVE, Lanelet2, CommonRoad or SUMO) with the points `start` and `goal`.
    `scenario` is a scenario, of whose actors only those exist that are fed. Frames are right-handed: x forward, y to the left, metres,
    headings from x towards y.

    `config`, `set`, `seed`, `threads`, `streams`, `log` and `allow_code` are those of `swerve.run`. `out` is a folder for log,
    metrics and report, in place of `log`; both replace the results of an earlier run. `seconds` is the end of the drive at the latest.

    Used as a context manager, it finishes at the end; after an exception it leaves a log that can be read up to there.

    Raises ValueError with all that is wrong with a file, a key or a message.
    """

    def __init__(
        self,
        config: FileOrDict | None = None,
        *,
        route: Sequence[tuple[float, float]] | NDArray[np.float64] | None = None,
        map: str | os.PathLike[str] | None = None,
        scenario: FileOrDict | None = None,
        start: tuple[float, float] | None = None,
        goal: tuple[float, float] | None = None,
        speed_mps: float | None = None,
        lane_width_m: float = 3.5,
        lanes_left: int = 0,
        lanes_right: int = 0,
        seconds: float = 3600.0,
        set: Mapping[str, Any] | None = None,
        seed: int | None = None,
        threads: int = 1,
        streams: Iterable[str] | None = None,
        log: str | os.PathLike[str] | None = None,
        out: str | os.PathLike[str] | None = None,
        allow_code: bool = False,
    ) -> None:
        if sum(way is not None for way in (route, map, scenario)) != 1:
            raise ValueError("the stack needs one way: expected `route`, `map` or `scenario`")
        if log is not None and out is not None:
            raise ValueError("log and out: expected one of them, the folder `out` has a log")
        way: dict[str, Any] = {"seconds": seconds, "lane_width_m": lane_width_m}
        way |= {"lanes_left": lanes_left, "lanes_right": lanes_right}
        if route is not None:
            points = np.asarray(route, dtype=float)
            if points.ndim != 2 or points.shape[1] != 2:
                raise ValueError(f"route: expected rows of x and y, found an array of shape {points.shape}")
            way["route"] = [(float(x), float(y)) for x, y in points]
        if map is not None:
            way |= {"map": os.fspath(map)}
            if start is not None and goal is not None:
                way["ends"] = [start, goal]
        if scenario is not None:
            checked_file("scenario", scenario)
            way["scenario"] = scenario
        if speed_mps is not None:
            way["speed_mps"] = float(speed_mps)
        self._guest = _swerve.Guest(
            way,
            config=config,
            set=None if set is None else dict(set),
            seed=seed,
            threads=checked_threads(threads),
            streams=checked_names("streams", streams),
            log=log,
            out=out,
            allow_code=allow_code,
        )
        self._inputs = {
            name: Input(_known(type_name), doc, readers, latency_ns * 1e-9)
            for name, type_name, doc, readers, latency_ns in self._guest.inputs()
        }
        self._now_s, self._until_s = self._guest.times()
        self._result: Result | None = None
        self.commands: list[Commanded] = []
        """Commands that became visible in the last advance, in order."""

    @property
    def inputs(self) -> dict[str, Input]:
        """Streams that the world feeds, by name."""
        return dict(self._inputs)

    @property
    def streams(self) -> list[str]:
        """Names of all streams."""
        return self._guest.streams()

    @property
    def lights(self) -> list[str]:
        """Names of the traffic lights: of a scenario on a map those with phases; with `map.all_lights = true`, all."""
        return self._guest.lights()

    @property
    def now_s(self) -> float:
        """Instant that the stack was advanced to, seconds."""
        return self._now_s

    @property
    def until_s(self) -> float:
        """Last instant that it can be advanced to, seconds."""
        return self._until_s

    @property
    def route(self) -> NDArray[np.float64]:
        """Points of the route's centre line, an array of x and y, metres."""
        return np.array(self._guest.route())

    @property
    def result(self) -> Result:
        """Result of the run, once it has finished."""
        if self._result is None:
            raise ValueError("the stack has not finished: expected `finish()` before")
        return self._result

    def feed(self, name: str, message: messages.Message) -> None:
        """Feeds a message of an input, before the stack is advanced to the message's stamp.

        Raises ValueError if there is no such input, or if type, numbers or stamp are wrong.
        """
        expected = self._inputs.get(name)
        if expected is not None and not isinstance(message, expected.message_type):
            wanted, found = expected.message_type.__name__, type(message).__name__
            raise ValueError(f"`{name}`: expected messages of type {wanted}, found {found}")
        self._guest.feed(name, message.to_plain())

    def feed_scene(self, ego: EgoState, obstacles: Sequence[Obstacle]) -> EndReason | None:
        """Feeds a world without sensors: the ego and everybody else, as they are at the ego's stamp.

        The stack gets the pose and the list of obstacles, which are ordered by identity from 1 on. Log and metrics get the state
        of the world, with the ego's collisions. Returns the reason for the end of the scenario, if it is over.
        """
        plain = ObstacleList(ego.stamp, list(obstacles)).to_plain()
        ended = self._guest.feed_scene(ego.to_plain(), plain)
        return None if ended is None else EndReason(ended)

    def feed_lights(self, ego: EgoState, signals: Mapping[str, Signal]) -> None:
        """Feeds signals of `lights`, by name, as they are at the ego's stamp. A stack that reads lights in images, or none,
        ignores them.

        Raises ValueError if there is no light of a name, or as `feed`.
        """
        self._guest.feed_lights(ego.to_plain(), {name: Signal(signal).value for name, signal in signals.items()})

    def advance_to(self, t_s: float) -> Command:
        """Advances to an instant in seconds; returns the newest command that is visible then. Before the first command all its
        numbers are zero. `commands` has those that became visible since the last advance.

        Raises ValueError if the instant is before the last one or after the end, or if an operator fails.
        """
        newest, new = self._guest.advance_to(t_s)
        self._now_s = float(t_s)
        self.commands = [Commanded(at, origin, Command(*numbers)) for at, origin, numbers in new]
        return Command(0.0, 0.0, 0.0) if newest is None else Command(*newest[2])

    def newest(self, stream: str) -> Any:
        """Newest message of any stream, or `None` before the first."""
        found = self._guest.newest(stream)
        return None if found is None else message_class(found[0]).from_plain(found[1])

    def finish(self) -> Result:
        """Ends the run and completes the log.

        The verdict is `unfinished` unless the world fed its states, by `feed_scene` or to the stream `world`.
        """
        if self._result is None:
            driven = self._guest.finish()
            self._result = Result(
                metrics=json.loads(driven["metrics"]),
                story=driven["story"],
                streams=streams_of(driven["streams"]),
                config=driven["config"],
                scenario=driven["scenario"],
            )
        return self._result

    def __enter__(self) -> Stack:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.finish()
        else:
            self._guest.drop()
