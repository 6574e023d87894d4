"""Actors and their blueprints."""

from __future__ import annotations

import math
from copy import deepcopy
from fnmatch import fnmatch
from typing import TYPE_CHECKING

from .values import (
    BoundingBox,
    Location,
    Rotation,
    TrafficLightState,
    Transform,
    Vector3D,
    VehicleControl,
    VehiclePhysicsControl,
)

if TYPE_CHECKING:
    from .world import World

WHEELBASE_M, REAR_M = 2.86, 1.43
CARS = {
    "vehicle.lincoln.mkz_2020": (2.45, 0.92, 0.75),
    "vehicle.tesla.model3": (2.4, 1.08, 0.74),
    "walker.pedestrian.0001": (0.19, 0.19, 0.93),
}
SENSORS = ("camera.rgb", "lidar.ray_cast", "other.imu", "other.gnss", "other.collision")


class ActorBlueprint:
    def __init__(self, id: str) -> None:
        self.id = id
        self.attributes: dict[str, str] = {}

    def set_attribute(self, key: str, value: str) -> None:
        if not isinstance(value, str):
            raise TypeError(f"{key}: expected a text, found {value!r}")
        self.attributes[key] = value


class BlueprintLibrary:
    def find(self, id: str) -> ActorBlueprint:
        if id not in CARS and id.removeprefix("sensor.") not in SENSORS:
            raise IndexError(f"blueprint '{id}' not found")
        return ActorBlueprint(id)


class Actor:
    def __init__(self, world: World, id: int, blueprint: ActorBlueprint, transform: Transform) -> None:
        self.id, self.type_id, self.attributes = id, blueprint.id, dict(blueprint.attributes)
        self.is_alive = True
        self._world, self._transform = world, deepcopy(transform)

    def get_transform(self) -> Transform:
        return deepcopy(self._transform)

    def get_location(self) -> Location:
        return self.get_transform().location

    def destroy(self) -> bool:
        self.is_alive = False
        self._world.remove(self)
        return True


class Vehicle(Actor):
    """A kinematic bicycle. Its origin is in the middle between the axles, on the ground."""

    def __init__(self, world: World, id: int, blueprint: ActorBlueprint, transform: Transform) -> None:
        super().__init__(world, id, blueprint, transform)
        self.bounding_box = BoundingBox(Location(z=CARS[blueprint.id][2]), Vector3D(*CARS[blueprint.id]))
        self.speed_mps = self.accel_mps2 = self.yaw_rate_radps = 0.0
        """At the rear axle; the yaw rate is positive clockwise."""
        self._control, self._physics = VehicleControl(), VehiclePhysicsControl()

    def apply_control(self, control: VehicleControl) -> None:
        self._control = deepcopy(control)

    def get_control(self) -> VehicleControl:
        return deepcopy(self._control)

    def get_physics_control(self) -> VehiclePhysicsControl:
        return deepcopy(self._physics)

    def step(self, dt_s: float) -> None:
        control, here = self._control, self._transform
        wanted = 4.2 * control.throttle * (1 - self.speed_mps / 45) - 9.0 * control.brake - 0.05 - 0.0004 * self.speed_mps**2
        speed_mps = max(0.0, self.speed_mps + wanted * dt_s)
        self.accel_mps2, self.speed_mps = (speed_mps - self.speed_mps) / dt_s, speed_mps
        wheels_deg = control.steer * self._physics.wheels[0].max_steer_angle * self._steering_share()
        self.yaw_rate_radps = speed_mps * math.tan(math.radians(wheels_deg)) / WHEELBASE_M
        rear, yaw = here.beside(-REAR_M, 0.0), math.radians(here.rotation.yaw)
        rear = Location(rear.x + speed_mps * math.cos(yaw) * dt_s, rear.y + speed_mps * math.sin(yaw) * dt_s, rear.z)
        turned = Rotation(yaw=here.rotation.yaw + math.degrees(self.yaw_rate_radps * dt_s))
        self._transform = Transform(Transform(rear, turned).beside(REAR_M, 0.0), turned)

    def _steering_share(self) -> float:
        points, kmh = self._physics.steering_curve, 3.6 * self.speed_mps
        for low, high in zip(points, points[1:]):
            if kmh <= high.x:
                return low.y + (kmh - low.x) / (high.x - low.x) * (high.y - low.y)
        return points[-1].y

    def _turned(self, forward: float, right: float) -> Vector3D:
        yaw = math.radians(self._transform.rotation.yaw)
        cos, sin = math.cos(yaw), math.sin(yaw)
        return Vector3D(forward * cos - right * sin, forward * sin + right * cos, 0.0)

    def get_velocity(self) -> Vector3D:
        """Of the origin, in the axes of the world, m/s."""
        return self._turned(self.speed_mps, REAR_M * self.yaw_rate_radps)

    def get_acceleration(self) -> Vector3D:
        """In the axes of the world, m/s²."""
        return self._turned(self.accel_mps2, self.speed_mps * self.yaw_rate_radps)

    def get_angular_velocity(self) -> Vector3D:
        """Degrees per second."""
        return Vector3D(z=math.degrees(self.yaw_rate_radps))

    def touches(self, other: Vehicle) -> bool:
        """Overlap of the two rectangles: no axis of either separates them."""
        corners = [one.corners() for one in (self, other)]
        for one in (self, other):
            for angle in (0.0, 90.0):
                axis = math.radians(one._transform.rotation.yaw + angle)
                spans = [[p.x * math.cos(axis) + p.y * math.sin(axis) for p in each] for each in corners]
                if max(spans[0]) < min(spans[1]) or max(spans[1]) < min(spans[0]):
                    return False
        return True

    def corners(self) -> list[Location]:
        x, y = self.bounding_box.extent.x, self.bounding_box.extent.y
        return [self._transform.beside(a * x, b * y) for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))]


class TrafficLight(Actor):
    """A mast at the place of a signal of the map, with the direction of the traffic that it is for. It is green until
    `set_state`; of the head, see the camera."""

    def __init__(self, world: World, id: int, signal: str, transform: Transform) -> None:
        super().__init__(world, id, ActorBlueprint("traffic.traffic_light"), transform)
        self._signal, self._state = signal, TrafficLightState.Green

    def get_opendrive_id(self) -> str:
        return self._signal

    def get_state(self) -> TrafficLightState:
        return self._state

    def set_state(self, state: TrafficLightState) -> None:
        self._state = state


class ActorList(list[Actor]):
    def filter(self, pattern: str) -> ActorList:
        return ActorList(actor for actor in self if fnmatch(actor.type_id, pattern))
