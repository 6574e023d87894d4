"""Client and world."""

from __future__ import annotations

import os
from copy import copy
from dataclasses import dataclass
from pathlib import Path

from .actors import CARS, Actor, ActorBlueprint, ActorList, BlueprintLibrary, TrafficLight, Vehicle
from .maps import Map
from .sensors import Sensor
from .values import Timestamp, Transform, WorldSnapshot


@dataclass
class WorldSettings:
    synchronous_mode: bool = False
    no_rendering_mode: bool = False
    fixed_delta_seconds: float | None = None


class World:
    """A town. It advances by `tick` in synchronous mode only."""

    def __init__(self, map: Map) -> None:
        self._map, self._settings = map, WorldSettings()
        self._actors: list[Actor] = []
        self._frame, self._now_s, self._next = 1000, 17.0, 24
        for signal, place in map.signals().items():
            self._next += 1
            self._actors.append(TrafficLight(self, self._next, signal, place))

    def get_map(self) -> Map:
        return self._map

    def get_settings(self) -> WorldSettings:
        return copy(self._settings)

    def apply_settings(self, settings: WorldSettings) -> int:
        self._settings = copy(settings)
        return self._frame

    def get_blueprint_library(self) -> BlueprintLibrary:
        return BlueprintLibrary()

    def get_actors(self) -> ActorList:
        return ActorList(self._actors)

    def vehicles(self) -> list[Vehicle]:
        return [actor for actor in self._actors if isinstance(actor, Vehicle)]

    def lights(self) -> list[TrafficLight]:
        return [actor for actor in self._actors if isinstance(actor, TrafficLight)]

    def spawn_actor(self, blueprint: ActorBlueprint, transform: Transform, attach_to: Actor | None = None) -> Actor:
        self._next += 1
        if blueprint.id in CARS:
            made: Actor = Vehicle(self, self._next, blueprint, transform)
            assert isinstance(made, Vehicle)
            if any(made.touches(each) for each in self.vehicles()):
                raise RuntimeError("Spawn failed because of collision at spawn position")
        elif isinstance(attach_to, Vehicle):
            made = Sensor(self, self._next, blueprint, transform, attach_to)
        else:
            raise RuntimeError(f"{blueprint.id}: expected a vehicle to attach it to")
        self._actors.append(made)
        return made

    def remove(self, actor: Actor) -> None:
        self._actors.remove(actor)

    def tick(self) -> int:
        """Advances by a step; controls that were applied before act in it. Returns the number of the frame."""
        step_s = self._settings.fixed_delta_seconds
        if not self._settings.synchronous_mode or step_s is None:
            raise RuntimeError("the stand-in for CARLA advances in synchronous mode with a fixed step only")
        for vehicle in self.vehicles():
            vehicle.step(step_s)
        self._frame, self._now_s = self._frame + 1, self._now_s + step_s
        for actor in list(self._actors):
            if isinstance(actor, Sensor):
                actor.sense(self._frame, self._now_s, step_s)
        return self._frame

    def get_snapshot(self) -> WorldSnapshot:
        step_s = self._settings.fixed_delta_seconds or 0.0
        return WorldSnapshot(self._frame, Timestamp(self._frame, self._now_s, step_s))


class Client:
    def __init__(self, host: str = "localhost", port: int = 2000) -> None:
        self._world: World | None = None

    def set_timeout(self, seconds: float) -> None:
        pass

    def load_world(self, name: str) -> World:
        file = Path(os.environ["FAKE_CARLA_MAPS"]) / f"{name}.xodr"
        if not file.is_file():
            raise RuntimeError(f"map not found: {name}")
        self._world = World(Map(name, file, os.environ.get("FAKE_CARLA_VERSION", "0.9.15")))
        return self._world

    def get_world(self) -> World:
        if self._world is None:
            raise RuntimeError("expected `load_world` before")
        return self._world
