"""highway-env as the world of a run (`pip install highway-env`): three lanes and 15 cars, 50 steps a second.

    swerve run examples/python/highway_world_scenario.toml -c examples/python/highway_world.toml

highway-env has y and angles to the right, Swerve to the left; its cars are given by their centres, Swerve's ego by its rear axle.
"""

import math

import gymnasium
import highway_env

import swerve
from swerve.messages import ActorKind, Command, EgoState, Extent, Obstacle, ObstacleList, Pose2, Vector2

SEEN_M = 100.0
gymnasium.register_envs(highway_env)


class Highway(swerve.World):
    sensors = {"obstacles": ObstacleList}

    def reset(self, start: swerve.Start) -> swerve.Scene:
        keys = start.read_keys(cars=15, speed_mps=20.0)
        hz = round(1e9 / start.step_ns)
        lanes = {"lanes_count": 3, "initial_lane_id": 1, "vehicles_count": keys.cars, "ego_spacing": 3}
        steps = {"simulation_frequency": hz, "policy_frequency": hz, "action": {"type": "ContinuousAction"}}
        self.env = gymnasium.make("highway-v0", config={**lanes, **steps}).unwrapped
        self.env.reset(seed=start.seed)
        self.car, self.wheelbase_m = self.env.vehicle, start.shape.wheelbase_m
        self.car.speed, self.accel_mps2, self.steering_rad = keys.speed_mps, 0.0, 0.0
        self.rear_m = 0.5 * start.shape.length_m - start.shape.rear_overhang_m
        self.x_m, self.y_m = self.car.position - [start.pose.x_m + self.rear_m, 0.0]
        self.others = [one for one in self.env.road.vehicles if one is not self.car]
        return self.scene()

    def step(self, command: Command, dt_ns: int) -> swerve.Scene:
        self.accel_mps2, self.steering_rad = 3.0 * command.throttle - 8.0 * command.brake, command.steering_rad
        self.car.act({"acceleration": self.accel_mps2, "steering": -self.steering_rad})
        self.env.road.act()
        self.env.road.step(dt_ns * 1e-9)
        self.car.speed = max(self.car.speed, 0.0)
        return self.scene()

    def scene(self) -> swerve.Scene:
        middle, speed = self.pose(self.car), float(self.car.speed)
        back, yaw = -self.rear_m, speed * math.tan(self.steering_rad) / self.wheelbase_m
        turn = middle.heading_rad
        pose = Pose2(middle.x_m + back * math.cos(turn), middle.y_m + back * math.sin(turn), turn)
        return swerve.Scene(EgoState(self.now, pose, speed, self.accel_mps2, speed * yaw, yaw, self.steering_rad), self.seen())

    def seen(self) -> list[Obstacle]:
        cars = [(k, one, Vector2(float(one.velocity[0]), -float(one.velocity[1]))) for k, one in enumerate(self.others, 1)]
        return [Obstacle(k, ActorKind.CAR, self.pose(one), Extent(one.LENGTH, one.WIDTH, 1.5), v, 1.0) for k, one, v in cars]

    def pose(self, one: object) -> Pose2:
        return Pose2(float(one.position[0] - self.x_m), -float(one.position[1] - self.y_m), -float(one.heading))

    def observe(self, name: str) -> ObstacleList:
        return ObstacleList(self.now, [o for o in self.seen() if abs(o.pose.x_m - self.pose(self.car).x_m) < SEEN_M])
