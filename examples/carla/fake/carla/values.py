"""Types of values: metres, degrees, left-handed axes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum


@dataclass
class Vector2D:
    x: float = 0.0
    y: float = 0.0


@dataclass
class Vector3D:
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


@dataclass
class Location(Vector3D):
    def distance(self, other: Vector3D) -> float:
        return math.dist((self.x, self.y, self.z), (other.x, other.y, other.z))


@dataclass
class Rotation:
    """Degrees. Yaw is clockwise seen from above."""

    pitch: float = 0.0
    yaw: float = 0.0
    roll: float = 0.0


@dataclass
class Transform:
    location: Location = field(default_factory=Location)
    rotation: Rotation = field(default_factory=Rotation)

    def beside(self, forward_m: float, right_m: float, up_m: float = 0.0) -> Location:
        """Place relative to this one; only the yaw counts."""
        cos, sin = math.cos(math.radians(self.rotation.yaw)), math.sin(math.radians(self.rotation.yaw))
        x = self.location.x + forward_m * cos - right_m * sin
        return Location(x, self.location.y + forward_m * sin + right_m * cos, self.location.z + up_m)


@dataclass
class BoundingBox:
    location: Location = field(default_factory=Location)
    extent: Vector3D = field(default_factory=Vector3D)
    """Half the sizes."""


@dataclass
class VehicleControl:
    throttle: float = 0.0
    steer: float = 0.0
    """-1 to 1, positive to the right."""
    brake: float = 0.0
    hand_brake: bool = False
    reverse: bool = False
    manual_gear_shift: bool = False
    gear: int = 0


class TrafficLightState(Enum):
    Red = 0
    Yellow = 1
    Green = 2
    Off = 3
    Unknown = 4

    def __str__(self) -> str:
        return self.name


@dataclass
class WheelPhysicsControl:
    max_steer_angle: float = 70.0
    """Degrees."""


@dataclass
class VehiclePhysicsControl:
    wheels: list[WheelPhysicsControl] = field(default_factory=lambda: [WheelPhysicsControl() for _ in range(4)])
    steering_curve: list[Vector2D] = field(
        default_factory=lambda: [Vector2D(0, 1), Vector2D(20, 0.9), Vector2D(60, 0.8), Vector2D(120, 0.7)]
    )
    """Speed in km/h, and share of the wheels' range."""


@dataclass
class Timestamp:
    frame: int
    elapsed_seconds: float
    delta_seconds: float


@dataclass
class WorldSnapshot:
    frame: int
    timestamp: Timestamp
