"""Sensors and the layouts of their data."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .actors import Actor, ActorBlueprint, TrafficLight, Vehicle
from .values import TrafficLightState, Transform, Vector3D

Array = NDArray[np.float64]


@dataclass
class SensorData:
    frame: int
    timestamp: float
    transform: Transform


@dataclass
class Image(SensorData):
    width: int
    height: int
    fov: float
    raw_data: bytes
    """Rows of pixels: blue, green, red, alpha, a byte each."""


@dataclass
class LidarMeasurement(SensorData):
    channels: int
    horizontal_angle: float
    raw_data: bytes
    """Points by channel: x, y, z, intensity, 32-bit floats each, in the sensor's left-handed axes."""


@dataclass
class IMUMeasurement(SensorData):
    accelerometer: Vector3D
    gyroscope: Vector3D
    compass: float


@dataclass
class GnssMeasurement(SensorData):
    latitude: float
    longitude: float
    altitude: float


@dataclass
class CollisionEvent(SensorData):
    actor: Actor
    other_actor: Actor
    normal_impulse: Vector3D


HEAD_M, TOP_M, ASIDE_M = (0.52, 1.16), 5.2, -1.5
"""Width and height of a traffic light's head, height of its top, and its place beside the mast, to the right."""
LAMPS = {
    TrafficLightState.Red: (1 / 6, (30, 40, 235)),
    TrafficLightState.Yellow: (1 / 2, (30, 190, 240)),
    TrafficLightState.Green: (5 / 6, (120, 230, 20)),
}
"""Place of a lamp from the top of the head, and its colour: blue, green, red."""


def _draw(pixels: NDArray[np.uint8], focal_px: float, eye: Transform, light: TrafficLight) -> None:
    """Draws the head of a light that faces the camera: a dark box with one lamp."""
    mast = light.get_transform()
    at, yaw = mast.beside(0.0, ASIDE_M), math.radians(eye.rotation.yaw)
    dx, dy = at.x - eye.location.x, at.y - eye.location.y
    ahead_m, right_m = dx * math.cos(yaw) + dy * math.sin(yaw), dy * math.cos(yaw) - dx * math.sin(yaw)
    if not 1.0 < ahead_m < 100.0 or math.cos(math.radians(mast.rotation.yaw) - yaw) < 0.5:
        return
    x_m = (np.arange(pixels.shape[1]) + 0.5 - pixels.shape[1] / 2) * ahead_m / focal_px - right_m
    down_m = (np.arange(pixels.shape[0]) + 0.5 - pixels.shape[0] / 2) * ahead_m / focal_px + TOP_M - eye.location.z
    columns = np.flatnonzero(np.abs(x_m) < HEAD_M[0] / 2)
    rows = np.flatnonzero((down_m >= 0.0) & (down_m < HEAD_M[1]))
    head = np.ix_(rows, columns)
    pixels[head] = (22, 27, 25, 255)
    if light.get_state() in LAMPS:
        place, colour = LAMPS[light.get_state()]
        is_lit = np.hypot(x_m[columns][None, :], down_m[rows][:, None] - place * HEAD_M[1]) < 0.14
        pixels[head] = np.where(is_lit[:, :, None], np.array((*colour, 255), np.uint8), pixels[head])


class Sensor(Actor):
    """A sensor that is attached to a vehicle. Of its rotation only the yaw counts."""

    def __init__(self, world: Any, id: int, blueprint: ActorBlueprint, place: Transform, parent: Vehicle) -> None:
        super().__init__(world, id, blueprint, place)
        if place.rotation.pitch or place.rotation.roll:
            raise ValueError("the stand-in for CARLA has no pitch and roll of sensors")
        self.parent, self._place, self._callback = parent, place, None
        self._random = random.Random(int(self.attributes.get("noise_seed", "0")))
        self._turn = 0.0
        self._touching: set[int] = set()

    _callback: Callable[[Any], Any] | None

    def listen(self, callback: Callable[[Any], Any]) -> None:
        self._callback = callback

    def stop(self) -> None:
        self._callback = None

    def number(self, key: str, default: float) -> float:
        return float(self.attributes.get(key, default))

    def get_transform(self) -> Transform:
        body, at = self.parent.get_transform(), self._place.location
        body.location = body.beside(at.x, at.y, at.z)
        body.rotation.yaw += self._place.rotation.yaw
        return body

    def sense(self, frame: int, now_s: float, dt_s: float) -> None:
        """Calls the listener with the data of a frame."""
        if self._callback is None:
            return
        head = (frame, now_s, self.get_transform())
        if self.type_id == "sensor.other.collision":
            for event in self._collisions(head):
                self._callback(event)
            return
        make = {
            "sensor.other.imu": self._imu,
            "sensor.other.gnss": self._gnss,
            "sensor.lidar.ray_cast": self._lidar,
            "sensor.camera.rgb": self._camera,
        }[self.type_id]
        self._callback(make(head, dt_s))

    def _others(self) -> list[Vehicle]:
        return [each for each in self._world.vehicles() if each is not self.parent]

    def _collisions(self, head: tuple[Any, Any, Any]) -> list[CollisionEvent]:
        touched = [each for each in self._others() if each.touches(self.parent)]
        new = [each for each in touched if each.id not in self._touching]
        self._touching = {each.id for each in touched}
        return [CollisionEvent(*head, self.parent, each, Vector3D()) for each in new]

    def _imu(self, head: tuple[Any, Any, Any], _: float) -> IMUMeasurement:
        car = self.parent
        accel = Vector3D(car.accel_mps2, car.speed_mps * car.yaw_rate_radps, 9.81)
        north = math.radians(head[2].rotation.yaw + 90.0) % (2 * math.pi)
        return IMUMeasurement(*head, accel, Vector3D(z=car.yaw_rate_radps), north)

    def _gnss(self, head: tuple[Any, Any, Any], _: float) -> GnssMeasurement:
        at = self._world.get_map().transform_to_geolocation(head[2].location)
        noise = [self._random.gauss(0.0, self.number(f"noise_{key}_stddev", 0.0)) for key in ("lat", "lon", "alt")]
        return GnssMeasurement(*head, at.latitude + noise[0], at.longitude + noise[1], at.altitude + noise[2])

    def _lidar(self, head: tuple[Any, Any, Any], dt_s: float) -> LidarMeasurement:
        channels, turn = int(self.number("channels", 32)), 2 * math.pi * self.number("rotation_frequency", 10.0) * dt_s
        columns = max(1, round(self.number("points_per_second", 56_000) * dt_s / channels))
        elevations = np.radians(np.linspace(self.number("lower_fov", -30.0), self.number("upper_fov", 10.0), channels))
        azimuths = self._turn + turn * np.arange(columns) / columns
        self._turn = (self._turn + turn) % (2 * math.pi)
        up, around = (each.ravel() for each in np.meshgrid(elevations, azimuths, indexing="ij"))
        rays = np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], axis=1)
        ranges = self._cast(rays, head[2])
        hit = ranges < self.number("range", 10.0)
        points = rays[hit] * ranges[hit, None]
        rows = np.column_stack([points, np.exp(-0.004 * ranges[hit])]).astype(np.float32)
        return LidarMeasurement(*head, channels, self._turn, rows.tobytes())

    def _camera(self, head: tuple[Any, Any, Any], _: float) -> Image:
        """Blue sky, grey ground, red columns where there is another vehicle, and the heads of traffic lights."""
        width, height = int(self.number("image_size_x", 800)), int(self.number("image_size_y", 600))
        fov = self.number("fov", 90.0)
        pixels = np.full((height, width, 4), (235, 160, 60, 255), np.uint8)
        pixels[height // 2 :] = (100, 100, 100, 255)
        right = (np.arange(width) + 0.5 - width / 2) / (width / (2 * math.tan(math.radians(fov) / 2)))
        rays = np.stack([np.ones(width), right, np.zeros(width)], axis=1)
        flat = Transform(head[2].location, head[2].rotation)
        flat.location.z = 0.5
        pixels[height * 2 // 5 : height * 3 // 5, self._cast(rays, flat) < 80.0] = (20, 20, 200, 255)
        focal_px = width / (2 * math.tan(math.radians(fov) / 2))
        for light in self._world.lights():
            _draw(pixels, focal_px, head[2], light)
        return Image(*head, width, height, fov, pixels.tobytes())

    def _cast(self, rays: Array, eye: Transform) -> Array:
        """Ranges at which rays in the sensor's axes hit the ground or a box of another actor, in lengths of the rays."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ranges = np.where(rays[:, 2] < -1e-9, -eye.location.z / rays[:, 2], np.inf)
            for other in self._others():
                at, box = other.get_transform(), other.bounding_box.extent
                turn = math.radians(at.rotation.yaw)
                dx, dy = eye.location.x - at.location.x, eye.location.y - at.location.y
                start = (dx * math.cos(turn) + dy * math.sin(turn), dy * math.cos(turn) - dx * math.sin(turn), eye.location.z)
                angle = math.radians(eye.rotation.yaw) - turn
                x = rays[:, 0] * math.cos(angle) - rays[:, 1] * math.sin(angle)
                y = rays[:, 0] * math.sin(angle) + rays[:, 1] * math.cos(angle)
                sides = ((-box.x, box.x, x, start[0]), (-box.y, box.y, y, start[1]), (0.0, 2 * box.z, rays[:, 2], start[2]))
                near, far = np.zeros(len(rays)), np.full(len(rays), np.inf)
                for low, high, along, begin in sides:
                    ends = np.sort(np.stack([(low - begin) / along, (high - begin) / along]), axis=0)
                    near, far = np.fmax(near, ends[0]), np.fmin(far, ends[1])
                ranges = np.where((near <= far) & (near > 0), np.minimum(ranges, near), ranges)
        return ranges
