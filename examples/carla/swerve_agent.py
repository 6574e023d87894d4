"""Swerve as an agent of the CARLA Leaderboard, versions 1.0 and 2.x, track MAP.

    leaderboard_evaluator.py --agent swerve_agent.py --agent-config my.toml --track MAP ...

The agent config is a configuration of Swerve; without one it is `lidar_objects`. The way follows the plan of the Leaderboard over
the lanes of the town's OpenDRIVE map. Traffic lights are read in images, stop signs in the map. The pose comes from satellite
fixes, compass and speedometer.
"""

from __future__ import annotations

import math
import os
import tempfile
from pathlib import Path
from typing import Any

import carla
import carla_frames as frames
from leaderboard.autoagents.autonomous_agent import AutonomousAgent, Track

import swerve
from swerve.messages import EgoState, Pose2

STEP_S = 0.05
SPEED_MPS = 8.0
NOISE_M, DRIFT_M = 0.6, 0.03  # of a fix, and of the dead-reckoned position in a step
TURN_S = 0.1  # of the Leaderboard's lidar: half a turn in each frame
CAMERA, SIGNALS, LIDAR, STEERING = frames.Camera(), frames.SIGNALS, frames.Lidar(), frames.Steering()


def get_entry_point() -> str:
    return "SwerveAgent"


class PoseFilter:
    """Position by dead reckoning, corrected by fixes with the gain of a Kalman filter; heading by the compass."""

    def __init__(self, x_m: float, y_m: float, heading_rad: float) -> None:
        self.pose, self.speed_mps, self.accel_mps2 = Pose2(x_m, y_m, heading_rad), 0.0, 0.0
        self.variance_m2 = NOISE_M**2

    def step(self, dt_s: float, speed_mps: float, yaw_rate_radps: float, compass_rad: float, fix: tuple[float, float]) -> None:
        """`fix` is the place of the rear axle in the map, metres. Version 2.x has frames without compass (NaN)."""
        turned = frames.wrapped(self.pose.heading_rad + yaw_rate_radps * dt_s)
        middle_rad = self.pose.heading_rad + yaw_rate_radps * dt_s / 2
        x_m = self.pose.x_m + speed_mps * dt_s * math.cos(middle_rad)
        y_m = self.pose.y_m + speed_mps * dt_s * math.sin(middle_rad)
        variance_m2 = self.variance_m2 + DRIFT_M**2
        gain = variance_m2 / (variance_m2 + NOISE_M**2)
        heading_rad = frames.heading(compass_rad) if math.isfinite(compass_rad) else turned
        self.pose = Pose2(x_m + gain * (fix[0] - x_m), y_m + gain * (fix[1] - y_m), heading_rad)
        self.variance_m2 = (1 - gain) * variance_m2
        self.accel_mps2 += 0.3 * ((speed_mps - self.speed_mps) / dt_s - self.accel_mps2)
        self.speed_mps = speed_mps


class SwerveAgent(AutonomousAgent):  # type: ignore[misc, unused-ignore]
    """The stack, stepped by the Leaderboard."""

    stack: swerve.Stack | None = None

    def setup(self, path_to_conf_file: str, *_: Any) -> None:
        self.track = Track.MAP
        self.config = path_to_conf_file or "lidar_objects"
        self.inputs = frames.inputs_of(self.config)
        self.filter: PoseFilter | None = None
        self.halves: list[Any] = []
        self.start_s = self.last_s = self.steer = 0.0

    def sensors(self) -> list[dict[str, Any]]:
        """All in CARLA's axes, relative to the middle of the car; lidar and `front` only if the configuration reads them. Lights
        are read in the images of `front`, else of `signals`."""

        def at(place_m: tuple[float, float, float]) -> dict[str, float]:
            return {"x": place_m[0] - frames.REAR_M, "y": -place_m[1], "z": place_m[2], "roll": 0.0, "pitch": 0.0, "yaw": 0.0}

        def camera(name: str, own: frames.Camera) -> dict[str, Any]:
            size = {"width": own.width_px, "height": own.height_px, "fov": own.fov_deg}
            return {"type": "sensor.camera.rgb", "id": name, **at(own.at_m), **size}

        middle = at((frames.REAR_M, 0.0, 0.0))
        roof = {"type": "sensor.lidar.ray_cast", "id": "roof", **at(LIDAR.at_m)}
        return [
            camera("front", CAMERA) if "front.rgb" in self.inputs else camera("signals", SIGNALS),
            *([roof] if "roof.points" in self.inputs else []),
            {"type": "sensor.other.imu", "id": "imu", **middle},
            {"type": "sensor.other.gnss", "id": "gnss", **middle},
            {"type": "sensor.speedometer", "id": "speed", "reading_frequency": 20},
            {"type": "sensor.opendrive_map", "id": "map", "reading_frequency": 1},
        ]

    def begin(self, opendrive: str, fix: Any, compass_rad: float, now_s: float) -> None:
        """Makes the stack: the way from the first fix over the points of the plan."""
        reference = frames.GeoReference.of(opendrive)
        plan = [reference.to_map(point["lat"], point["lon"]) for point, _ in self._global_plan]
        # The car starts at the first point of the plan: of both projections of a fix, the true one is near to it.
        both = (reference.to_map, reference.to_map_0_9_16)
        self.to_map = min(both, key=lambda each: math.dist(each(fix[0], fix[1]), plan[0]))
        heading_rad = frames.heading(compass_rad)
        x_m, y_m = self.rear(fix, heading_rad)
        start = {"x_m": x_m, "y_m": y_m, "heading_rad": heading_rad}
        points = [{"x_m": x, "y_m": y} for x, y in plan[1:]]
        for point, (transform, _) in zip(points, self._global_plan_world_coord[1:]):
            point["heading_rad"] = frames.pose(transform).heading_rad  # selects the lane where several cross
        route = {"start": start, "via": points[:-1], "goal": points[-1], "target_speed_mps": SPEED_MPS}
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "map.xodr"
            file.write_text(opendrive)
            town = {"file": os.fspath(file), "all_lights": True}
            scenario = {"name": "leaderboard", "map": town, "ego": route, "end": {"timeout_s": 3600.0}}
            keys = frames.mounting(self.inputs) | frames.lights_in_images(self.inputs)
            self.stack = swerve.Stack(self.config, scenario=scenario, set=keys)
        self.filter, self.start_s, self.last_s = PoseFilter(x_m, y_m, heading_rad), now_s, now_s - STEP_S

    def rear(self, fix: Any, heading_rad: float) -> tuple[float, float]:
        """Place of the rear axle; the antenna is above the middle of the car."""
        x_m, y_m = self.to_map(fix[0], fix[1])
        return x_m - frames.REAR_M * math.cos(heading_rad), y_m - frames.REAR_M * math.sin(heading_rad)

    def run_step(self, input_data: dict[str, Any], timestamp: float) -> Any:
        """A control for the next step. Until the map has arrived, the car stands."""
        data = {name: each for name, (_, each) in input_data.items()}
        fix, inertial, speed_mps = data["gnss"][:2].tolist(), data["imu"].tolist(), float(data["speed"]["speed"])
        if self.stack is None and "map" in data and math.isfinite(inertial[6]):
            self.begin(data["map"]["opendrive"], fix, inertial[6], timestamp)
        if self.stack is None or self.filter is None:
            return carla.VehicleControl(brake=1.0)
        stamp = round((timestamp - self.start_s) * 1e9)
        measured = frames.imu(stamp, inertial[:3], inertial[3:6])
        yaw_rate_radps = measured.gyro_radps[2]
        place = self.rear(fix, self.filter.pose.heading_rad)
        self.filter.step(timestamp - self.last_s, speed_mps, yaw_rate_radps, inertial[6], place)
        self.last_s = timestamp
        wheels_rad = STEERING.wheels_rad(self.steer, speed_mps)
        motion = (speed_mps, self.filter.accel_mps2, measured.accel_mps2[1], yaw_rate_radps, wheels_rad)
        self.feed(stamp, EgoState(stamp, self.filter.pose, *motion), measured, data)
        throttle, self.steer, brake = STEERING.control(self.stack.advance_to(stamp * 1e-9), speed_mps)
        return carla.VehicleControl(throttle, self.steer, brake)

    def feed(self, stamp: int, pose: EgoState, measured: Any, data: dict[str, Any]) -> None:
        assert self.stack is not None
        self.stack.feed("pose", pose)
        self.stack.feed("imu", measured)
        if "roof" in data:
            self.halves = [*self.halves[-1:], data["roof"]]
            parts = list(zip((TURN_S / 2, 0.0) if len(self.halves) == 2 else (0.0,), self.halves))
            self.stack.feed("roof.points", LIDAR.cloud(stamp, parts))
        if "front" in data:
            self.stack.feed("front.rgb", CAMERA.image(stamp, data["front"]))
        if "signals" in data:
            self.stack.feed("signals.rgb", SIGNALS.image(stamp, data["signals"]))

    def destroy(self) -> None:
        if self.stack is not None:
            self.stack.finish()
            self.stack = None
