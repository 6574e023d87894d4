"""CARLA's numbers as Swerve's messages, and Swerve's commands as CARLA's controls.

CARLA is left-handed: x forward, y to the right, z up, yaw in degrees clockwise seen from above, steering positive to the right.
Swerve is right-handed, with y to the left, in metres and radians, and so is the OpenDRIVE file of CARLA's map.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import swerve
from swerve.messages import (
    ActorKind,
    CameraInfo,
    Command,
    EgoState,
    Extent,
    Image,
    Imu,
    Intrinsics,
    Obstacle,
    PointCloud,
    Pose2,
    Signal,
    Transform,
    Vector2,
)

EARTH_RADIUS_M = 6_378_137.0
TRANSVERSE_SCALE = 0.9996  # of CARLA 0.9.16 for maps without a projection
REAR_M = 1.43  # from the rear axle to the origin of CARLA's Lincoln MKZ
# Optical axes of a camera that looks forward: x right, y down, z forward.
FORWARD = (-0.5, 0.5, -0.5, 0.5)


def pose(transform: Any, ahead_m: float = 0.0, right_m: float = 0.0) -> Pose2:
    """Pose of a point `ahead_m` and `right_m` of the origin of a `carla.Transform`."""
    at, yaw = transform.location, math.radians(transform.rotation.yaw)
    x_m = at.x + ahead_m * math.cos(yaw) - right_m * math.sin(yaw)
    y_m = at.y + ahead_m * math.sin(yaw) + right_m * math.cos(yaw)
    return Pose2(x_m, -y_m, wrapped(-yaw))


def wrapped(angle_rad: float) -> float:
    """The same angle in (-pi, pi]."""
    return math.pi - (math.pi - angle_rad) % (2 * math.pi)


def ego(stamp: int, vehicle: Any, steering_rad: float, rear_m: float = REAR_M) -> EgoState:
    """State of the ego at its rear axle, from a `carla.Vehicle`."""
    at = pose(vehicle.get_transform(), -rear_m)
    cos, sin = math.cos(at.heading_rad), math.sin(at.heading_rad)
    velocity, accel = vehicle.get_velocity(), vehicle.get_acceleration()
    along = [vector.x * cos - vector.y * sin for vector in (velocity, accel)]
    lateral_mps2 = -accel.x * sin - accel.y * cos
    yaw_rate_radps = -math.radians(vehicle.get_angular_velocity().z)
    return EgoState(stamp, at, along[0], along[1], lateral_mps2, yaw_rate_radps, steering_rad)


def obstacle(actor: Any) -> Obstacle:
    """A `carla.Vehicle` or `carla.Walker` in sight."""
    box, velocity = actor.bounding_box, actor.get_velocity()
    size = Extent(2 * box.extent.x, 2 * box.extent.y, 2 * box.extent.z)
    center = pose(actor.get_transform(), box.location.x, box.location.y)
    return Obstacle(actor.id, kind(actor), center, size, Vector2(velocity.x, -velocity.y), 1.0)


def kind(actor: Any) -> ActorKind:
    """Kind of an actor, by `base_type` (from CARLA 0.9.14 on) and the number of wheels."""
    if actor.type_id.startswith("walker."):
        return ActorKind.PEDESTRIAN
    kinds = {"truck": ActorKind.TRUCK, "bus": ActorKind.TRUCK, "motorcycle": ActorKind.MOTORCYCLE, "bicycle": ActorKind.CYCLIST}
    two = ActorKind.CYCLIST if actor.attributes.get("number_of_wheels") == "2" else ActorKind.CAR
    return kinds.get(actor.attributes.get("base_type", "").lower(), two)


def signal(state: Any) -> Signal | None:
    """A `carla.TrafficLightState`; `None` if it is unknown."""
    known = {"Green": Signal.GREEN, "Yellow": Signal.YELLOW, "Red": Signal.RED, "Off": Signal.OFF}
    return known.get(str(state).rsplit(".", maxsplit=1)[-1])


def imu(stamp: int, accel_mps2: Sequence[float], gyro_radps: Sequence[float]) -> Imu:
    """The inertial unit: y changes its sign; of rates, those about x and z do."""
    (ax, ay, az), (gx, gy, gz) = (tuple(map(float, values)) for values in (accel_mps2, gyro_radps))
    return Imu(stamp, (ax, -ay, az), (-gx, gy, -gz))


def heading(compass_rad: float) -> float:
    """Heading by the compass, which is 0 to the north (-y of CARLA, +y of the map) and increases clockwise."""
    return wrapped(math.pi / 2 - compass_rad)


@dataclass(frozen=True)
class Camera:
    """A camera that looks forward; its place is that of `camera.NAME.at_m`, in the ego frame."""

    width_px: int = 800
    height_px: int = 600
    fov_deg: float = 70.0
    at_m: tuple[float, float, float] = (1.75, 0.0, 1.35)

    def image(self, stamp: int, bgra: NDArray[np.uint8]) -> Image:
        """An image of CARLA, rows of blue, green, red, alpha."""
        rows = bgra.reshape(self.height_px, self.width_px, 4)
        focal_px = self.width_px / (2 * math.tan(math.radians(self.fov_deg) / 2))
        lens = (0.0, 0.0, 0.0, 0.0, 0.0)
        projection = Intrinsics(focal_px, focal_px, self.width_px / 2, self.height_px / 2, lens, False)
        camera = CameraInfo(projection, Transform(FORWARD, self.at_m))
        return Image(stamp, self.width_px, self.height_px, camera, np.ascontiguousarray(rows[:, :, 2::-1]))


# Wide: a head above a car at its stop line is still in the image.
SIGNALS = Camera(width_px=1024, height_px=768, fov_deg=100.0)


@dataclass(frozen=True)
class Lidar:
    """A lidar with evenly spaced channels, without roll, pitch and yaw."""

    channels: int = 64
    lower_deg: float = -30.0
    upper_deg: float = 10.0
    at_m: tuple[float, float, float] = (REAR_M, 0.0, 2.0)

    def cloud(self, stamp: int, parts: Sequence[tuple[float, NDArray[np.float32]]]) -> PointCloud:
        """A sweep of parts of a turn: their age in seconds, and rows of x, y, z, intensity. CARLA casts all rays of a part at
        the instant of its frame."""
        points = np.concatenate([part.reshape(-1, 4) for _, part in parts])
        ages = np.concatenate([np.full(part.size // 4, -age_s, np.float32) for age_s, part in parts])
        x, y, z, intensity = points.T
        elevation_deg = np.degrees(np.arctan2(z, np.hypot(x, y)))
        ring = (elevation_deg - self.lower_deg) / (self.upper_deg - self.lower_deg) * (self.channels - 1)
        rings = np.clip(np.rint(ring), 0, self.channels - 1).astype(np.uint16)
        return PointCloud(stamp, x.copy(), -y, z.copy(), intensity.copy(), rings, ages)


def mounting(inputs: Iterable[str]) -> dict[str, Any]:
    """Keys of the stack by which its `lidar.roof` and `camera.front`, if it reads them, are those of this file."""
    keys: dict[str, Any] = {}
    if "roof.points" in inputs:
        keys["lidar.roof.at_m"] = list(Lidar.at_m)
    if "front.rgb" in inputs:
        names = ("width_px", "height_px", "fov_deg")
        keys |= {f"camera.front.{name}": getattr(Camera, name) for name in names} | {"camera.front.at_m": list(Camera.at_m)}
    return keys


def lights_in_images(inputs: Iterable[str]) -> dict[str, Any]:
    """Keys of the stack by which it reads traffic lights in the images of `camera.front`, if it has that, else of the camera
    `signals`. The map has the places of masts; the heads are within `search_m` of them."""
    heads = {"kind": "traffic_lights", "head_m": [0.52, 1.16], "top_m": 4.5, "search_m": 8.0}
    if "front.rgb" in inputs:
        return {"operator.lights": {**heads, "reads": {"image": "front.rgb"}}}
    camera = {name: getattr(SIGNALS, name) for name in ("width_px", "height_px", "fov_deg")} | {"at_m": list(SIGNALS.at_m)}
    return {"camera.signals": camera, "operator.lights": {**heads, "reads": {"image": "signals.rgb"}}}


def inputs_of(config: Any) -> set[str]:
    """Streams that the stack of a configuration reads from outside."""
    known = swerve.Stack(config, route=[(0.0, 0.0), (100.0, 0.0)]).inputs
    return {name for name, each in known.items() if each.readers}


@dataclass(frozen=True)
class Steering:
    """Range of a car's front wheels; by default that of most of CARLA's cars."""

    max_rad: float = math.radians(70.0)
    curve: Sequence[tuple[float, float]] = ((0.0, 1.0), (20.0, 0.9), (60.0, 0.8), (120.0, 0.7))
    """Speed in km/h, and share of the range that CARLA grants at it."""

    @classmethod
    def of(cls, vehicle: Any) -> Steering:
        """The range of a `carla.Vehicle`."""
        physics = vehicle.get_physics_control()
        curve = tuple((float(point.x), float(point.y)) for point in physics.steering_curve)
        return cls(math.radians(physics.wheels[0].max_steer_angle), curve or cls.curve)

    def range_rad(self, speed_mps: float) -> float:
        """Largest angle of the wheels at a speed."""
        kmh, shares = zip(*self.curve)
        return self.max_rad * float(np.interp(3.6 * abs(speed_mps), list(kmh), list(shares)))

    def wheels_rad(self, steer: float, speed_mps: float) -> float:
        """Angle of the front wheels, positive to the left, by the `steer` of a `carla.VehicleControl`."""
        return -steer * self.range_rad(speed_mps)

    def control(self, command: Command, speed_mps: float) -> tuple[float, float, float]:
        """The first fields of a `carla.VehicleControl`: throttle, steer, brake."""
        steer = -command.steering_rad / self.range_rad(speed_mps)
        return command.throttle, min(max(steer, -1.0), 1.0), command.brake


@dataclass(frozen=True)
class GeoReference:
    """Origin of a map, and the projection of CARLA's satellite receiver."""

    latitude_deg: float
    longitude_deg: float

    @classmethod
    def of(cls, opendrive: str) -> GeoReference:
        """The origin by `geoReference` of an OpenDRIVE text; without one, that of the Leaderboard (42, 2)."""
        found = [re.search(rf"\+{key}=([-+.\deE]+)", opendrive) for key in ("lat_0", "lon_0")]
        if found[0] is None or found[1] is None:
            return cls(42.0, 2.0)
        return cls(float(found[0][1]), float(found[1][1]))

    def to_map(self, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
        """Place in the map, metres, of a point of the Leaderboard's plan, or of a fix of CARLA up to 0.9.15: the Mercator
        projection of a sphere."""
        scale = EARTH_RADIUS_M * math.cos(math.radians(self.latitude_deg))
        north = [math.log(math.tan(math.radians(90 + each) / 2)) for each in (latitude_deg, self.latitude_deg)]
        return scale * math.radians(longitude_deg - self.longitude_deg), scale * (north[0] - north[1])

    def to_map_0_9_16(self, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
        """The same for a fix of CARLA 0.9.16: the transverse Mercator projection of a sphere, its latitudes mirrored at the
        origin (issue 9389 of CARLA)."""
        scale, latitude = EARTH_RADIUS_M * TRANSVERSE_SCALE, math.radians(latitude_deg)
        east = math.radians(longitude_deg - self.longitude_deg)
        mirrored = math.atan2(math.tan(latitude), math.cos(east)) - math.radians(self.latitude_deg)
        return scale * math.atanh(math.cos(latitude) * math.sin(east)), -scale * mirrored
