"""A small stand-in for the module `carla`, for tests without a server: one town, kinematic cars, flat ground.

Names, units, axes and layouts of data are those of CARLA 0.9.15, as its documentation gives them. Everything here computes in
CARLA's left-handed axes. The roads are those of an OpenDRIVE file: `NAME.xodr` in the folder `FAKE_CARLA_MAPS`. It contains no
rendering, suspension, tyres, weather or phases of lights.
"""

from .actors import Actor, ActorBlueprint, ActorList, BlueprintLibrary, TrafficLight, Vehicle
from .maps import GeoLocation, Map
from .sensors import CollisionEvent, GnssMeasurement, Image, IMUMeasurement, LidarMeasurement, Sensor
from .values import (
    BoundingBox,
    Location,
    Rotation,
    TrafficLightState,
    Transform,
    Vector2D,
    Vector3D,
    VehicleControl,
    VehiclePhysicsControl,
    WheelPhysicsControl,
)
from .world import Client, World, WorldSettings

__all__ = [
    "Actor",
    "ActorBlueprint",
    "ActorList",
    "BlueprintLibrary",
    "BoundingBox",
    "Client",
    "CollisionEvent",
    "GeoLocation",
    "GnssMeasurement",
    "IMUMeasurement",
    "Image",
    "LidarMeasurement",
    "Location",
    "Map",
    "Rotation",
    "Sensor",
    "TrafficLight",
    "TrafficLightState",
    "Transform",
    "Vector2D",
    "Vector3D",
    "Vehicle",
    "VehicleControl",
    "VehiclePhysicsControl",
    "WheelPhysicsControl",
    "World",
    "WorldSettings",
]
