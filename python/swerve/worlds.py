"""Worlds in Python, in place of the simulated one.

    class MyWorld(swerve.World):
        sensors = {"seen": messages.ObstacleList}

        def reset(self, start: swerve.Start) -> swerve.Scene: ...
        def step(self, command: messages.Command, dt_ns: int) -> swerve.Scene: ...
        def observe(self, name: str) -> messages.Message | None: ...

The configuration names the class for the world and its sensors:

    [operator.world]
    kind = "python_world"

    [operator.seen]
    kind = "python_sensor"
    message = "ObstacleList"
    period_ms = 100

    [process.world]
    operators = ["world", "seen"]
    python = "my_world.py:MyWorld"

Run, study, log, metrics, report, `replay` and `why` work as with the simulated world.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from .messages import Command, EgoState, Message, Obstacle, ObstacleList, WorldState
from .starts import Start
from .streams import message_class


@dataclass
class Scene:
    """A world at one instant: the ego and everybody else. Swerve adds collisions, leaving the road, and the end."""

    ego: EgoState
    """The ego; its pose is that of the centre of the rear axle."""
    others: Sequence[Obstacle] = ()
    """Everybody else, ordered by identity from 1 on."""


class World(ABC):
    """A world, stepped by a run. Equal starts and commands give equal scenes: it reads no clock and no global.

    A `Scene` is judged by the rules of the simulated world. A `WorldState` is taken as it is; its `ended` ends the run.
    """

    sensors: ClassVar[Mapping[str, type[Message]]] = {}
    """Messages of its sensors, by the names of their operators."""
    now: int = 0
    """Instant of the scene, nanoseconds: the stamp of all its messages. It is set before each call."""

    @abstractmethod
    def reset(self, start: Start) -> Scene | WorldState:
        """The world at its first instant."""

    @abstractmethod
    def step(self, command: Command, dt_ns: int) -> Scene | WorldState:
        """Moves the world by `dt_ns` nanoseconds, to `now`, under the command that was visible before."""

    def observe(self, name: str) -> Message | None:
        """What a sensor sees of the scene; `None` for nothing. The world stays as it is."""
        raise NotImplementedError(f"`{type(self).__name__}` has no method `observe`, which its sensor `{name}` needs")


class Steps:
    """The steps of a world and of its sensors, in one process.

    Observations are made in the step of the world: steps of sensors may be late.
    """

    #: Observations that wait for the steps of their sensors.
    WAITING_MAX = 64

    def __init__(self, world: type[World], start: Start) -> None:
        self._world = world()
        self._start = start
        self._command = Command(0.0, 0.0, 0.0)
        self._stamp: int | None = None
        self._sensors: dict[str, tuple[int, dict[int, dict[str, Any]]]] = {}

    def world(self, stamp: int, command: dict[str, Any] | None) -> dict[str, Any]:
        """A step of the world, with plain values: its state, or its ego and obstacles."""
        world, self._world.now = self._world, stamp
        if self._stamp is None:
            method, found = "reset", world.reset(self._start)
        else:
            method, found = "step", world.step(self._command, stamp - self._stamp)
        self._stamp = stamp
        # The command that is visible now moves the world in the next step, as in the simulated world.
        newest = self._command if command is None else Command.from_plain(command)
        if all(map(math.isfinite, (newest.steering_rad, newest.throttle, newest.brake))):
            self._command = newest
        if isinstance(found, WorldState):
            answer = {"state": found.to_plain()}
        elif isinstance(found, Scene):
            answer = {"ego": found.ego.to_plain(), "obstacles": ObstacleList(stamp, list(found.others)).to_plain()}
        else:
            name, kind = type(world).__name__, type(found).__name__
            raise TypeError(f"`{name}.{method}` returned a `{kind}`; expected a `Scene` or a `WorldState`")
        for name, (period_ns, waiting) in self._sensors.items():
            if stamp % period_ns == 0:
                self._observe(name, stamp, waiting)
        return answer

    def _observe(self, name: str, stamp: int, waiting: dict[int, dict[str, Any]]) -> None:
        message = self._world.observe(name)
        if message is None:
            return
        kind = self._world.sensors[name]
        if not isinstance(message, kind):
            found, world = type(message).__name__, type(self._world).__name__
            raise TypeError(f"`{world}.observe` of sensor `{name}` returned a `{found}`; expected a `{kind.__name__}`")
        waiting[stamp] = message.to_plain()
        while len(waiting) > self.WAITING_MAX:
            del waiting[min(waiting)]

    def sensor(self, name: str, type_name: str, period_ns: int) -> Callable[..., tuple[int, list[Any]]]:
        """The steps of a sensor; raises TypeError if the class declares another one."""
        kind, declared = message_class(type_name), self._world.sensors.get(name)
        if declared is not kind:
            says = ", ".join(f"{name}: {kind.__name__}" for name, kind in self._world.sensors.items()) or "none"
            raise TypeError(
                f"operator `{name}` is a sensor of {kind.__name__}; `{type(self._world).__name__}.sensors` declares {says}"
            )
        waiting: dict[int, dict[str, Any]] = {}
        self._sensors[name] = (period_ns, waiting)

        def step(facts: dict[str, Any], read: list[list[tuple[dict[str, Any], Any]]]) -> tuple[int, list[Any]]:
            return 0, [waiting.pop(read[0][-1][0]["stamp"], None) if read[0] else None]

        return step
