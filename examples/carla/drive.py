"""Swerve drives a car in CARLA, in synchronous mode.

    python drive.py --town Town01 --spawn 10 --goal 80 --log drive.mcap

CARLA waits for the stack in each step, and the stack's run times count nevertheless: a control is that of the newest command
that is visible at the instant of the frame. The pose and the other road users are CARLA's own, unless the configuration reads a
lidar `roof` or a camera `front` (`--config lidar_objects`); the states of traffic lights are CARLA's.
"""

from __future__ import annotations

import argparse
import math
import os
import queue
import tempfile
from collections.abc import Container
from pathlib import Path
from typing import Any

import carla
import carla_frames as frames
import numpy as np

import swerve
from swerve.messages import Signal

SIGHT_M = 100.0
TIMEOUT_S = 10.0


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Drives a car in CARLA.")
    parser.add_argument("--host", default="localhost")
    parser.add_argument("--port", type=int, default=2000)
    parser.add_argument("--town", default="Town01")
    parser.add_argument("--spawn", type=int, default=0, help="spawn point to start from")
    parser.add_argument("--goal", type=int, default=1, help="spawn point to drive to")
    parser.add_argument("--vehicle", default="vehicle.lincoln.mkz_2020")
    parser.add_argument("--speed", type=float, default=8.0, help="target speed, m/s")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--step", type=float, default=0.05, help="step of the world, s")
    parser.add_argument("--config", default=None, help="configuration of the stack")
    parser.add_argument("--log", default=None)
    return parser.parse_args()


class Car:
    """The car with its sensors."""

    def __init__(self, world: Any, blueprint: str, start: Any) -> None:
        self.world, self.queues = world, dict[str, "queue.Queue[Any]"]()
        model = world.get_blueprint_library().find(blueprint)
        model.set_attribute("role_name", "hero")
        self.vehicle = world.spawn_actor(model, start)
        self.actors = [self.vehicle]
        self.steering = frames.Steering.of(self.vehicle)
        self.collisions: list[Any] = []
        self.add("sensor.other.collision", (frames.REAR_M, 0.0, 0.0), {}).listen(self.collisions.append)

    def add(self, kind: str, at_m: tuple[float, float, float], attributes: dict[str, Any]) -> Any:
        """Attaches a sensor at a place in the ego frame."""
        model = self.world.get_blueprint_library().find(kind)
        for key, value in attributes.items():
            model.set_attribute(key, str(value))
        place = carla.Transform(carla.Location(x=at_m[0] - frames.REAR_M, y=-at_m[1], z=at_m[2]))
        sensor = self.world.spawn_actor(model, place, attach_to=self.vehicle)
        self.actors.append(sensor)
        return sensor

    def queue(self, name: str, sensor: Any) -> None:
        self.queues[name] = queue.Queue()
        sensor.listen(self.queues[name].put)

    def wait(self, frame: int) -> dict[str, Any]:
        """The data of all sensors of a frame. A sensor may lack the first frames after it was spawned."""
        found: dict[str, Any] = {}
        for name, data in self.queues.items():
            while name not in found or found[name].frame < frame:
                try:
                    found[name] = data.get(timeout=TIMEOUT_S)
                except queue.Empty:
                    raise SystemExit(f"sensor {name}: no data of frame {frame} in {TIMEOUT_S:g} s") from None
        return found

    def destroy(self) -> None:
        for actor in reversed(self.actors):
            if actor is not self.vehicle:
                actor.stop()
            actor.destroy()


def add_sensors(car: Car, inputs: set[str], step_s: float) -> None:
    """The sensors that the configuration reads; a lidar makes a whole turn in each step."""
    car.queue("imu", car.add("sensor.other.imu", (frames.REAR_M, 0.0, 0.0), {}))
    if "roof.points" in inputs:
        lidar = frames.Lidar()
        keys = {"channels": lidar.channels, "lower_fov": lidar.lower_deg, "upper_fov": lidar.upper_deg, "range": 85,
                "points_per_second": round(30_000 / step_s), "rotation_frequency": 1 / step_s}
        car.queue("roof.points", car.add("sensor.lidar.ray_cast", lidar.at_m, keys))
    if "front.rgb" in inputs:
        camera = frames.Camera()
        keys = {"image_size_x": camera.width_px, "image_size_y": camera.height_px, "fov": camera.fov_deg}
        car.queue("front.rgb", car.add("sensor.camera.rgb", camera.at_m, keys))


def feed(stack: swerve.Stack, name: str, stamp: int, data: Any) -> None:
    if name == "imu":
        accel, gyro = data.accelerometer, data.gyroscope
        stack.feed(name, frames.imu(stamp, (accel.x, accel.y, accel.z), (gyro.x, gyro.y, gyro.z)))
    elif name == "roof.points":
        stack.feed(name, frames.Lidar().cloud(stamp, [(0.0, np.frombuffer(data.raw_data, np.float32))]))
    else:
        stack.feed(name, frames.Camera().image(stamp, np.frombuffer(data.raw_data, np.uint8)))


def signals(world: Any, known: Container[str]) -> dict[str, Signal]:
    """States of CARLA's traffic lights, by their identities in the OpenDRIVE file."""
    lights = world.get_actors().filter("traffic.traffic_light")
    states = {light.get_opendrive_id(): frames.signal(light.get_state()) for light in lights}
    return {name: state for name, state in states.items() if name in known and state is not None}


def drive(world: Any, stack: swerve.Stack, car: Car, steps: int) -> None:
    start_s: float | None = None
    for _ in range(steps):
        data = car.wait(world.tick())
        now_s = world.get_snapshot().timestamp.elapsed_seconds
        start_s = now_s if start_s is None else start_s
        stamp = round((now_s - start_s) * 1e9)
        for name, each in data.items():
            feed(stack, name, stamp, each)
        speed_mps = math.hypot(car.vehicle.get_velocity().x, car.vehicle.get_velocity().y)
        wheels_rad = car.steering.wheels_rad(car.vehicle.get_control().steer, speed_mps)
        here, actors = car.vehicle.get_location(), world.get_actors()
        others = [each for model in ("vehicle.*", "walker.pedestrian.*") for each in actors.filter(model)]
        near = [each for each in others if each.id != car.vehicle.id and each.get_location().distance(here) < SIGHT_M]
        obstacles = [frames.obstacle(each) for each in sorted(near, key=lambda each: int(each.id))]
        ego = frames.ego(stamp, car.vehicle, wheels_rad)
        stack.feed_lights(ego, signals(world, stack.lights))
        if stack.feed_scene(ego, obstacles):
            break
        command = stack.advance_to(stamp * 1e-9)
        car.vehicle.apply_control(carla.VehicleControl(*car.steering.control(command, speed_mps)))
    car.vehicle.apply_control(carla.VehicleControl(brake=1.0))  # a control holds until the next one


def main() -> None:
    args = arguments()
    client = carla.Client(args.host, args.port)
    client.set_timeout(60.0)
    world = client.load_world(args.town)
    places = world.get_map().get_spawn_points()
    if not all(0 <= index < len(places) for index in (args.spawn, args.goal)):
        raise SystemExit(f"--spawn, --goal: {args.town} has {len(places)} spawn points, from 0 on")
    before, settings = world.get_settings(), world.get_settings()
    settings.synchronous_mode, settings.fixed_delta_seconds = True, args.step
    world.apply_settings(settings)
    car: Car | None = None
    try:
        car = Car(world, args.vehicle, places[args.spawn])
        world.tick()
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "map.xodr"
            file.write_text(world.get_map().to_opendrive())
            start, goal = (frames.pose(places[index]) for index in (args.spawn, args.goal))
            points = [{"x_m": at.x_m, "y_m": at.y_m, "heading_rad": at.heading_rad} for at in (start, goal)]
            route = {"start": points[0], "goal": points[1], "target_speed_mps": args.speed}
            town = {"file": os.fspath(file), "all_lights": True}
            scenario = {"name": "carla", "map": town, "ego": route, "end": {"timeout_s": 3600.0}}
            inputs = frames.inputs_of(args.config)
            add_sensors(car, inputs, args.step)
            with swerve.Stack(args.config, scenario=scenario, set=frames.mounting(inputs), log=args.log) as stack:
                drive(world, stack, car, round(args.seconds / args.step))
        print(f"{stack.result.verdict}, {stack.now_s:.2f} s, {len(car.collisions)} collisions, digest {stack.result.digest}")
    finally:
        if car is not None:
            car.destroy()
        world.apply_settings(before)


if __name__ == "__main__":
    main()
