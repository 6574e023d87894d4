"""The stack of Swerve drives in highway-env (`pip install highway-env`): four lanes, 20 cars, 20 steps a second.

highway-env has y and angles to the right, Swerve to the left: y, heading and steering change their signs. Its cars are given by
their centres, Swerve's ego by its rear axle.
"""

import math

import gymnasium
import highway_env

import swerve
from swerve.messages import ActorKind, EgoState, Extent, Obstacle, Pose2, Vector2

HZ, REAR_M, LIMIT_MPS2, LIMIT_RAD = 20, 1.425, 5.0, math.pi / 4
gymnasium.register_envs(highway_env)
settings = {"vehicles_count": 20, "duration": 20, "simulation_frequency": HZ, "policy_frequency": HZ}
action = {"type": "ContinuousAction"}
env = gymnasium.make("highway-v0", config={**settings, "action": action, "lanes_count": 4}).unwrapped
env.reset(seed=3)
car, lane = env.vehicle, env.road.network.get_lane(env.vehicle.lane_index)
number = env.vehicle.lane_index[2]
route = [(float(x), -float(y)) for x, y in (lane.position(s, 0.0) for s in range(0, 1500, 20))]


def ego(stamp: int) -> EgoState:
    heading, (x, y) = -float(car.heading), car.position
    pose = Pose2(float(x) - REAR_M * math.cos(heading), -float(y) - REAR_M * math.sin(heading), heading)
    return EgoState(stamp, pose, float(car.speed), float(car.action["acceleration"]), 0.0, 0.0, -float(car.action["steering"]))


def others() -> list[Obstacle]:
    cars = [(number, one) for number, one in enumerate(env.road.vehicles, 1) if one is not car]
    return [
        Obstacle(number, ActorKind.CAR, Pose2(float(one.position[0]), -float(one.position[1]), -float(one.heading)),
                 Extent(one.LENGTH, one.WIDTH, 1.5), Vector2(float(one.velocity[0]), -float(one.velocity[1])), 1.0)
        for number, one in cars
    ]


lanes = {"lane_width_m": 4.0, "lanes_left": number, "lanes_right": 3 - number}
with swerve.Stack(route=route, speed_mps=25.0, **lanes) as stack:
    for k in range(20 * HZ):
        if stack.feed_scene(ego(k * 10**9 // HZ), others()):
            break
        command = stack.advance_to(k / HZ)
        accel_mps2 = 3.0 * command.throttle - 8.0 * command.brake
        env.step([min(max(accel_mps2 / LIMIT_MPS2, -1.0), 1.0), min(max(-command.steering_rad / LIMIT_RAD, -1.0), 1.0)])
nearest_m = stack.result.metrics["min_distance_m"]
print(f"{stack.now_s:.2f} s, crashed: {car.crashed}, {car.speed:.1f} m/s, {nearest_m:.2f} m, {stack.result.digest}")
