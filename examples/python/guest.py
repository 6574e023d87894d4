"""A world of a few lines of Python, in which the stack of Swerve drives: a lane with a bend, fog, and a crate that lies there.

The world steps 20 times a second and waits for the stack, whose planner takes its modelled time. `python guest.py 600` gives the
planner 600 ms: that is too late for the crate.
"""

import math
import sys

import swerve
from swerve.messages import ActorKind, EgoState, Extent, Obstacle, Pose2, Vector2

STEP_S = 0.05
WHEELBASE_M = 2.85
ACCEL_MAX_MPS2, BRAKE_MAX_MPS2 = 3.0, 8.0
SIGHT_M = 20.0


def street() -> list[tuple[float, float]]:
    """A straight of 60 m, and a bend to the left with a radius of 80 m."""
    arc = [0.1 * k for k in range(1, 11)]
    return [(6.0 * k, 0.0) for k in range(11)] + [(60 + 80 * math.sin(a), 80 - 80 * math.cos(a)) for a in arc]


class Car:
    """A kinematic bicycle about its rear axle, without delay."""

    def __init__(self) -> None:
        self.x_m, self.y_m, self.heading_rad, self.speed_mps = 2.0, 0.0, 0.0, 10.0
        self.accel_mps2 = self.steering_rad = 0.0

    def step(self, command: swerve.messages.Command) -> None:
        self.steering_rad = command.steering_rad
        self.accel_mps2 = ACCEL_MAX_MPS2 * command.throttle - BRAKE_MAX_MPS2 * command.brake
        self.speed_mps = max(0.0, self.speed_mps + self.accel_mps2 * STEP_S)
        self.x_m += self.speed_mps * math.cos(self.heading_rad) * STEP_S
        self.y_m += self.speed_mps * math.sin(self.heading_rad) * STEP_S
        self.heading_rad += self.yaw_rate_radps * STEP_S

    @property
    def yaw_rate_radps(self) -> float:
        return self.speed_mps * math.tan(self.steering_rad) / WHEELBASE_M

    def state(self, stamp: int) -> EgoState:
        pose, lateral_mps2 = Pose2(self.x_m, self.y_m, self.heading_rad), self.speed_mps * self.yaw_rate_radps
        return EgoState(stamp, pose, self.speed_mps, self.accel_mps2, lateral_mps2, self.yaw_rate_radps, self.steering_rad)


config = {"operator.planner.runtime": {"fixed_ms": float(sys.argv[1]) if len(sys.argv) > 1 else 50.0}}
car = Car()
with swerve.Stack(route=street(), speed_mps=10.0, set=config, out="guest") as stack:
    for k in range(600):
        t = STEP_S * k
        crate = Obstacle(1, ActorKind.STATIC, Pose2(50.0, 0.0, 0.0), Extent(1.0, 1.0, 1.0), Vector2(0.0, 0.0), 1.0)
        is_there = 50.0 - car.x_m < SIGHT_M and t < 10.0  # then somebody takes it away
        if stack.feed_scene(car.state(round(1e9 * t)), [crate] if is_there else []):
            break
        car.step(stack.advance_to(t))
print(f"{stack.result.verdict} at {stack.now_s:.2f} s, {stack.result.metrics['min_distance_m']:.2f} m, {stack.result.digest}")
