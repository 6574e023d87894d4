"""Steps an agent through a world, with the sensors, limits and layouts of data of the Leaderboard."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import carla
import numpy as np

LIMITS = {
    "sensor.camera.rgb": 8,
    "sensor.lidar.ray_cast": 2,
    "sensor.other.gnss": 1,
    "sensor.other.imu": 1,
    "sensor.speedometer": 1,
    "sensor.opendrive_map": 1,
}
NOISE_DEG = 5e-6
REACH_M = 3.0  # of a sensor from the middle of the car


def plan(places: list[carla.Transform], origin: tuple[float, float]) -> list[tuple[dict[str, float], Any]]:
    """The plan in degrees, by the Leaderboard's own projection in every version of CARLA."""
    scale = math.cos(math.radians(origin[0])) * 6_378_137.0
    north = math.log(math.tan(math.radians(90 + origin[0]) / 2))
    rows = []
    for at in (place.location for place in places):
        latitude = math.degrees(2 * math.atan(math.exp(north - at.y / scale)) - math.pi / 2)
        rows.append(({"lat": latitude, "lon": origin[1] + math.degrees(at.x / scale), "z": at.z}, "LANEFOLLOW"))
    return rows


class Wrapper:
    """The sensors of an agent on a car."""

    def __init__(self, world: carla.World, car: carla.Vehicle, agent: Any) -> None:
        self.world, self.car, self.agent = world, car, agent
        self.data: dict[str, tuple[int, Any]] = {}
        self.pseudo: dict[str, str] = {}
        self.step = 0
        kinds = [spec["type"] for spec in agent.sensors()]
        for kind in kinds:
            if kinds.count(kind) > LIMITS.get(kind, 0):
                raise ValueError(f"{kind}: too many sensors, or none allowed")
        for spec in agent.sensors():
            self.attach(spec)

    def attach(self, spec: dict[str, Any]) -> None:
        kind, name = spec["type"], spec["id"]
        if kind in ("sensor.speedometer", "sensor.opendrive_map"):
            self.pseudo[name] = kind
            return
        if math.hypot(spec["x"], spec["y"], spec["z"]) > REACH_M:
            raise ValueError(f"{name}: a sensor must be within {REACH_M} m of the car's origin")
        keys: dict[str, Any] = {}
        if kind == "sensor.camera.rgb":
            keys = {"image_size_x": spec["width"], "image_size_y": spec["height"], "fov": spec["fov"]}
        elif kind == "sensor.lidar.ray_cast":
            keys = {"range": 85, "rotation_frequency": 10, "channels": 64, "upper_fov": 10, "lower_fov": -30}
            keys["points_per_second"] = 600_000
        elif kind == "sensor.other.gnss":
            keys = {"noise_lat_stddev": NOISE_DEG, "noise_lon_stddev": NOISE_DEG, "noise_alt_stddev": NOISE_DEG}
        blueprint = self.world.get_blueprint_library().find(kind)
        for key, value in keys.items():
            blueprint.set_attribute(key, str(value))
        place = carla.Transform(carla.Location(spec["x"], spec["y"], spec["z"]), carla.Rotation(yaw=spec["yaw"]))
        sensor = self.world.spawn_actor(blueprint, place, attach_to=self.car)
        assert isinstance(sensor, carla.Sensor)
        sensor.listen(lambda data: self.data.__setitem__(name, (data.frame, layout(data))))

    def run(self, steps: int, after: Callable[[int, float], None] = lambda frame, now_s: None, lacking: int = 0) -> None:
        """Steps the agent; the first `lacking` frames have no map, as those of version 2.x may."""
        for step in range(self.step, self.step + steps):
            frame = self.world.tick()
            for name, kind in self.pseudo.items():
                if kind == "sensor.speedometer":
                    self.data[name] = (frame, {"speed": self.car.speed_mps})
                elif step >= lacking:
                    self.data[name] = (frame, {"opendrive": self.world.get_map().to_opendrive()})
            control = self.agent.run_step(dict(self.data), step * 0.05)
            control.manual_gear_shift = False
            self.car.apply_control(control)
            after(frame, step * 0.05)
        self.step += steps


def layout(data: Any) -> Any:
    """Data as the Leaderboard gives it to agents."""
    if isinstance(data, carla.Image):
        return np.frombuffer(data.raw_data, np.uint8).reshape(data.height, data.width, 4)
    if isinstance(data, carla.LidarMeasurement):
        return np.frombuffer(data.raw_data, np.float32).reshape(-1, 4)
    if isinstance(data, carla.GnssMeasurement):
        return np.array([data.latitude, data.longitude, data.altitude])
    accel, gyro = data.accelerometer, data.gyroscope
    return np.array([accel.x, accel.y, accel.z, gyro.x, gyro.y, gyro.z, data.compass])
