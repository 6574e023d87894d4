"""A simulator with one car on the topics of `carla_ros_bridge`, in simulated time.

    python3 carla_emulator.py DOMAIN carla [--slowness R] [--pause AT REAL] [--reset-at S] [--silent-at S]
                              [--speed MPS]

As in CARLA, the car's axes are left-handed (y to the right, yaw in degrees and clockwise), and its origin is at its
centre. Each frame is 50 ms of simulated time and takes `--slowness` times that in real time. A control holds until
the next one.
`--pause`: at the simulated time AT, nothing happens for REAL seconds of real time. `--reset-at`: the clock begins
anew. `--silent-at`: the clock is not published any more; the car goes on.
Each simulated second, and at the end, it prints one line of JSON: place of the rear axle in ROS's axes, speed, pedals
and steering. It ends when standard input is closed.
"""

import argparse
import json
import math
import sys
import threading
import time

from cyclonedds.domain import DomainParticipant

from ros_types import ros
from vehicle_emulator import DEFAULT, Side, taken

STEP_S, PARTS = 0.05, 5
BEGIN_S = 12.35  # the simulator has run before
WHEELBASE_M, REAR_AXLE_M = 2.86, 1.4  # the axle is behind the centre
STEER_MAX_DEG = 70.0
THROTTLE_MPS2, BRAKE_MPS2, ROLLING_MPS2 = 4.0, 8.0, 0.1


class Vehicle:
    """Rolls without slip. Left-handed: `y` to the right, `yaw_deg` clockwise; `x` and `y` are of the centre."""

    def __init__(self, speed):
        self.x, self.y, self.yaw_deg, self.speed = REAR_AXLE_M, 0.0, 0.0, speed
        self.rate_deg = self.throttle = self.steer = self.brake = 0.0

    def step(self, dt):
        push = THROTTLE_MPS2 * self.throttle if self.brake == 0.0 else 0.0
        self.speed = max(0.0, self.speed + (push - BRAKE_MPS2 * self.brake - ROLLING_MPS2) * dt)
        self.rate_deg = math.degrees(self.speed * math.tan(math.radians(STEER_MAX_DEG * self.steer)) / WHEELBASE_M)
        axle_x, axle_y = self.axle()
        yaw = math.radians(self.yaw_deg)
        axle_x, axle_y = axle_x + self.speed * math.cos(yaw) * dt, axle_y + self.speed * math.sin(yaw) * dt
        self.yaw_deg += self.rate_deg * dt
        yaw = math.radians(self.yaw_deg)
        self.x, self.y = axle_x + REAR_AXLE_M * math.cos(yaw), axle_y + REAR_AXLE_M * math.sin(yaw)

    def axle(self):
        yaw = math.radians(self.yaw_deg)
        return self.x - REAR_AXLE_M * math.cos(yaw), self.y - REAR_AXLE_M * math.sin(yaw)


class Bridge(Side):
    """Topics, types, frames and signs of `carla_ros_bridge`."""

    def __init__(self, participant):
        super().__init__(participant)
        self.control = self.reader("/carla/hero/vehicle_control_cmd", "carla_msgs/CarlaEgoVehicleControl", DEFAULT)
        self.clock = self.writer("/clock", "rosgraph_msgs/Clock", DEFAULT)
        self.pose = self.writer("/carla/hero/odometry", "nav_msgs/Odometry", DEFAULT)
        self.status = self.writer("/carla/hero/vehicle_status", "carla_msgs/CarlaEgoVehicleStatus", DEFAULT)
        self.newest_stamp = 0.0

    def read(self, car):
        for control in taken(self.control):
            numbers = [control.throttle, control.steer, control.brake]
            if not all(math.isfinite(n) for n in numbers) or max(map(abs, numbers)) > 1.0:
                self.refused += 1
                continue
            self.commands += 1
            self.newest_stamp = control.header.stamp.sec + 1e-9 * control.header.stamp.nanosec
            car.throttle, car.steer, car.brake = numbers

    def write(self, car, clock_s, is_silent):
        ns = round(clock_s * 1e9)
        clock = ros("rosgraph_msgs/Clock")()
        clock.clock.sec, clock.clock.nanosec = ns // 10**9, ns % 10**9
        if not is_silent:
            self.clock.write(clock)
        odometry = ros("nav_msgs/Odometry")()
        odometry.header.stamp, odometry.header.frame_id, odometry.child_frame_id = clock.clock, "map", "hero"
        pose, twist = odometry.pose.pose, odometry.twist.twist
        yaw = -math.radians(car.yaw_deg)
        pose.position.x, pose.position.y = car.x, -car.y
        pose.orientation.z, pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
        # Velocity of the centre, which also moves sideways in a bend.
        twist.linear.x, twist.linear.y = car.speed, -math.radians(car.rate_deg) * REAR_AXLE_M
        twist.angular.z = -math.radians(car.rate_deg)
        self.pose.write(odometry)
        status = ros("carla_msgs/CarlaEgoVehicleStatus")(velocity=math.hypot(twist.linear.x, twist.linear.y))
        status.header.stamp, status.header.frame_id = clock.clock, "map"
        status.orientation = pose.orientation
        control = status.control
        control.throttle, control.steer, control.brake, control.gear = car.throttle, car.steer, car.brake, 1
        self.status.write(status)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("domain", type=int)
    parser.add_argument("interface", choices=["carla"])
    parser.add_argument("--slowness", type=float, default=2.0)
    parser.add_argument("--pause", type=float, nargs=2, default=(math.inf, 0.0))
    parser.add_argument("--reset-at", type=float, default=math.inf)
    parser.add_argument("--silent-at", type=float, default=math.inf)
    parser.add_argument("--speed", type=float, default=0.0)
    args = parser.parse_args()
    car, bridge = Vehicle(args.speed), Bridge(DomainParticipant(args.domain))
    closed = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), closed.set()), daemon=True).start()
    print("ready", flush=True)

    due, frames, paused = time.monotonic(), 0, False

    def report(clock_s):
        axle_x, axle_y = car.axle()
        state = {"t": frames * STEP_S, "clock": clock_s, "x": axle_x, "y": -axle_y, "speed": car.speed}
        state |= {"throttle": car.throttle, "steer": car.steer, "brake": car.brake, "stamp": bridge.newest_stamp}
        state = {key: round(value, 3) for key, value in state.items()}
        print(json.dumps(state | {"commands": bridge.commands, "refused": bridge.refused}), flush=True)

    while not closed.is_set():
        t = frames * STEP_S
        if t >= args.pause[0] and not paused:
            paused, due = True, due + args.pause[1]
            time.sleep(max(0.0, due - time.monotonic()))
        bridge.read(car)
        for _ in range(PARTS):
            car.step(STEP_S / PARTS)
        frames += 1
        clock_s = t + STEP_S - (args.reset_at if t >= args.reset_at else -BEGIN_S)
        bridge.write(car, clock_s, t >= args.silent_at)
        if frames % round(1 / STEP_S) == 1:
            report(clock_s)
        due += STEP_S * args.slowness
        time.sleep(max(0.0, due - time.monotonic()))
    report(clock_s)


main()
