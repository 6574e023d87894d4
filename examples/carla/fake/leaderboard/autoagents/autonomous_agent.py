"""Base class of agents."""

from __future__ import annotations

from enum import Enum
from typing import Any


class Track(Enum):
    SENSORS = "SENSORS"
    MAP = "MAP"


class AutonomousAgent:
    """The constructor is that of version 2.x, or, with the path of the agent's configuration alone, that of 1.0."""

    def __init__(self, carla_host: str, carla_port: int | None = None, debug: bool = False) -> None:
        self.track = Track.SENSORS
        self._global_plan: list[tuple[dict[str, float], Any]] = []
        self._global_plan_world_coord: list[tuple[Any, Any]] = []
        if carla_port is None:
            self.setup(carla_host)

    def setup(self, path_to_conf_file: str) -> None:
        raise NotImplementedError

    def sensors(self) -> list[dict[str, Any]]:
        raise NotImplementedError

    def run_step(self, input_data: dict[str, Any], timestamp: float) -> Any:
        raise NotImplementedError

    def destroy(self) -> None:
        pass

    def set_global_plan(self, gps: list[tuple[dict[str, float], Any]], world: list[tuple[Any, Any]]) -> None:
        self._global_plan, self._global_plan_world_coord = gps, world
