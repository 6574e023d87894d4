"""A car on the other side of the network: kinematic, and driven by what arrives over ROS 2's topics.

    python3 vehicle_emulator.py DOMAIN autoware|dataspeed [--seconds S] [--silent-after S] [--driver-at S]
                                [--speed MPS] [--x M] [--y M] [--yaw RAD]

It reports itself at 50 Hz (pose and speed as `nav_msgs/Odometry` on /localization/kinematic_state or /odometry, and
the interface's own reports) and follows commands as such a vehicle does: only while engaged, only while they are
young (0.2 s, else it brakes by itself), only as far as it can; a driver who acts disengages it.
`--silent-after`: its topics cease, the car goes on. `--driver-at`: the driver takes over then.
Each second, and at the end, it prints one line of JSON with its state. It ends when standard input is closed.
"""

import argparse
import json
import math
import sys
import threading
import time

from cyclonedds.domain import DomainParticipant
from cyclonedds.internal import InvalidSample
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from ros_types import ros

STEP_S = 0.02
WHEELBASE_M, STEERING_RATIO, WHEEL_RADIUS_M = 2.85, 14.8, 0.33
STEERING_MAX_RAD, STEERING_RATE_RADPS = 0.61, 0.7
ACCEL_MAX_MPS2, BRAKE_MAX_MPS2, TIMEOUT_BRAKE_MPS2 = 3.0, 8.0, 3.0
COMMAND_TIMEOUT_S = 0.2

VEHICLE = Qos(
    Policy.Reliability.Reliable(duration(milliseconds=100)), Policy.Durability.Volatile, Policy.History.KeepLast(1)
)
DEFAULT = Qos(
    Policy.Reliability.Reliable(duration(milliseconds=100)), Policy.Durability.Volatile, Policy.History.KeepLast(10)
)
LATCHED = Qos(
    Policy.Reliability.Reliable(duration(milliseconds=100)), Policy.Durability.TransientLocal, Policy.History.KeepLast(1)
)


def taken(reader):
    """Messages that wait, without the samples that only tell of a writer's end."""
    return [sample for sample in reader.take(N=10) if not isinstance(sample, InvalidSample)]


class Car:
    """Rolls without slip; its origin is the centre of the rear axle."""

    def __init__(self, x, y, yaw, speed):
        self.x, self.y, self.yaw, self.speed = x, y, yaw, speed
        self.steering = self.accel = 0.0
        self.wanted_steering = self.wanted_accel = 0.0

    def step(self, dt):
        turn = STEERING_RATE_RADPS * dt
        target = max(-STEERING_MAX_RAD, min(STEERING_MAX_RAD, self.wanted_steering))
        self.steering += max(-turn, min(turn, target - self.steering))
        self.accel = max(-BRAKE_MAX_MPS2, min(ACCEL_MAX_MPS2, self.wanted_accel))
        before, self.speed = self.speed, self.speed + self.accel * dt
        if self.accel < 0.0 <= before and self.speed < 0.0:
            self.speed = 0.0  # brakes hold
        self.x += self.speed * math.cos(self.yaw) * dt
        self.y += self.speed * math.sin(self.yaw) * dt
        self.yaw += self.yaw_rate() * dt

    def yaw_rate(self):
        return self.speed * math.tan(self.steering) / WHEELBASE_M


class Side:
    """What both interfaces share: writers, readers, the switch, the age of the newest command."""

    def __init__(self, participant):
        self.participant = participant
        self.engaged = self.driver = False
        self.commands = self.refused = self.timeouts = 0
        self.newest = -math.inf

    def writer(self, topic, name, qos=VEHICLE):
        return DataWriter(self.participant, Topic(self.participant, f"rt{topic}", ros(name), qos=qos), qos=qos)

    def reader(self, topic, name, qos=VEHICLE):
        return DataReader(self.participant, Topic(self.participant, f"rt{topic}", ros(name), qos=qos), qos=qos)

    def accept(self, now, numbers):
        """Only numbers, and only while engaged."""
        if not all(math.isfinite(n) for n in numbers):
            self.refused += 1
            return False
        self.commands += 1
        self.newest = now
        return self.engaged

    def odometry(self, car, stamp, frame):
        odometry = ros("nav_msgs/Odometry")()
        odometry.header.stamp, odometry.header.frame_id, odometry.child_frame_id = stamp, frame, "base_link"
        pose, twist = odometry.pose.pose, odometry.twist.twist
        pose.position.x, pose.position.y = car.x, car.y
        pose.orientation.z, pose.orientation.w = math.sin(car.yaw / 2), math.cos(car.yaw / 2)
        twist.linear.x, twist.angular.z = car.speed, car.yaw_rate()
        return odometry


class Autoware(Side):
    """Speed and acceleration, angle of the road wheels; /autoware/engage is the switch."""

    AUTONOMOUS, MANUAL = 1, 4

    def __init__(self, participant):
        super().__init__(participant)
        vehicle = "autoware_vehicle_msgs"
        self.control = self.reader("/control/command/control_cmd", "autoware_control_msgs/Control")
        self.engage = self.reader("/autoware/engage", f"{vehicle}/Engage", DEFAULT)
        self.velocity = self.writer("/vehicle/status/velocity_status", f"{vehicle}/VelocityReport")
        self.steering = self.writer("/vehicle/status/steering_status", f"{vehicle}/SteeringReport")
        self.mode = self.writer("/vehicle/status/control_mode", f"{vehicle}/ControlModeReport")
        self.gear = self.writer("/vehicle/status/gear_status", f"{vehicle}/GearReport")
        self.pose = self.writer("/localization/kinematic_state", "nav_msgs/Odometry", DEFAULT)

    def read(self, car, now):
        for switch in taken(self.engage):
            self.engaged = switch.engage and not self.driver
        for control in taken(self.control):
            lateral, longitudinal = control.lateral, control.longitudinal
            numbers = [lateral.steering_tire_angle, longitudinal.velocity, longitudinal.acceleration]
            if self.accept(now, numbers):
                car.wanted_steering = lateral.steering_tire_angle
                car.wanted_accel = longitudinal.acceleration
                if not longitudinal.is_defined_acceleration:
                    car.wanted_accel = longitudinal.velocity - car.speed

    def write(self, car, stamp):
        vehicle = "autoware_vehicle_msgs"
        velocity = ros(f"{vehicle}/VelocityReport")(longitudinal_velocity=car.speed, heading_rate=car.yaw_rate())
        velocity.header.stamp, velocity.header.frame_id = stamp, "base_link"
        self.velocity.write(velocity)
        self.steering.write(ros(f"{vehicle}/SteeringReport")(stamp=stamp, steering_tire_angle=car.steering))
        mode = self.AUTONOMOUS if self.engaged else self.MANUAL
        self.mode.write(ros(f"{vehicle}/ControlModeReport")(stamp=stamp, mode=mode))
        self.gear.write(ros(f"{vehicle}/GearReport")(stamp=stamp, report=2))
        self.pose.write(self.odometry(car, stamp, "map"))


class Dataspeed(Side):
    """Angle of the steering wheel in degrees, pedals in percent or a speed; /vehicle/enable is the switch."""

    def __init__(self, participant):
        super().__init__(participant)
        ds = "ds_dbw_msgs"
        self.steering_cmd = self.reader("/vehicle/steering/cmd", f"{ds}/SteeringCmd", DEFAULT)
        self.brake_cmd = self.reader("/vehicle/brake/cmd", f"{ds}/BrakeCmd", DEFAULT)
        self.throttle_cmd = self.reader("/vehicle/throttle/cmd", f"{ds}/ThrottleCmd", DEFAULT)
        self.ulc_cmd = self.reader("/vehicle/ulc/cmd", f"{ds}/UlcCmd", DEFAULT)
        self.enable = self.reader("/vehicle/enable", "std_msgs/Empty", DEFAULT)
        self.disable = self.reader("/vehicle/disable", "std_msgs/Empty", DEFAULT)
        self.velocity = self.writer("/vehicle/vehicle_velocity", f"{ds}/VehicleVelocity", DEFAULT)
        self.steering = self.writer("/vehicle/steering/report", f"{ds}/SteeringReport", DEFAULT)
        self.brake = self.writer("/vehicle/brake/report", f"{ds}/BrakeReport", DEFAULT)
        self.wheels = self.writer("/vehicle/wheel_speeds", f"{ds}/WheelSpeeds", DEFAULT)
        self.enabled = self.writer("/vehicle/dbw_enabled", "std_msgs/Bool", LATCHED)
        self.pose = self.writer("/odometry", "nav_msgs/Odometry", DEFAULT)
        self.told = None

    def read(self, car, now):
        if taken(self.enable):
            self.engaged = not self.driver
        if taken(self.disable):
            self.engaged = False
        for cmd in taken(self.steering_cmd):
            if cmd.cmd_type == 2 and self.accept(now, [cmd.cmd]) and cmd.enable:
                car.wanted_steering = math.radians(cmd.cmd) / STEERING_RATIO
        for cmd in taken(self.throttle_cmd):
            if cmd.cmd_type == 14 and self.accept(now, [cmd.cmd]) and cmd.enable and cmd.cmd > 0.0:
                car.wanted_accel = ACCEL_MAX_MPS2 * cmd.cmd / 100
        for cmd in taken(self.brake_cmd):
            if cmd.cmd_type == 14 and self.accept(now, [cmd.cmd]) and cmd.enable and cmd.cmd > 0.0:
                car.wanted_accel = -BRAKE_MAX_MPS2 * cmd.cmd / 100
        for cmd in taken(self.ulc_cmd):
            if cmd.cmd_type == 1 and self.accept(now, [cmd.cmd, cmd.limit_accel, cmd.limit_decel]) and cmd.enable:
                car.wanted_accel = max(-cmd.limit_decel, min(cmd.limit_accel, 2.0 * (cmd.cmd - car.speed)))
                if cmd.cmd == 0.0 and car.speed < 0.2:
                    car.wanted_accel = -cmd.limit_decel  # it holds a car that is to stand

    def write(self, car, stamp):
        ds = "ds_dbw_msgs"
        velocity = ros(f"{ds}/VehicleVelocity")(
            vehicle_velocity_brake=car.speed, vehicle_velocity_propulsion=car.speed, dir_src=1
        )
        steering = ros(f"{ds}/SteeringReport")(
            steering_wheel_angle=math.degrees(car.steering) * STEERING_RATIO,
            steering_column_torque=math.nan,
            cmd_type=2,
            ready=True,
            enabled=self.engaged,
            override_active=self.driver,
        )
        brake = ros(f"{ds}/BrakeReport")(
            percent_output=max(0.0, -100 * car.accel / BRAKE_MAX_MPS2), enabled=self.engaged, override_active=self.driver
        )
        spin = car.speed / WHEEL_RADIUS_M
        wheels = ros(f"{ds}/WheelSpeeds")(front_left=spin, front_right=spin, rear_left=spin, rear_right=spin)
        for message, writer in ((velocity, self.velocity), (steering, self.steering), (brake, self.brake), (wheels, self.wheels)):
            message.header.stamp = stamp
            writer.write(message)
        if self.told != self.engaged:
            self.enabled.write(ros("std_msgs/Bool")(data=self.engaged))
            self.told = self.engaged
        self.pose.write(self.odometry(car, stamp, "map"))


def now_stamp():
    ns = time.time_ns()
    return ros("sensor_msgs/Imu")().header.stamp.__class__(sec=ns // 10**9, nanosec=ns % 10**9)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("domain", type=int)
    parser.add_argument("interface", choices=["autoware", "dataspeed"])
    parser.add_argument("--seconds", type=float, default=math.inf)
    parser.add_argument("--silent-after", type=float, default=math.inf)
    parser.add_argument("--driver-at", type=float, default=math.inf)
    parser.add_argument("--speed", type=float, default=0.0)
    parser.add_argument("--x", type=float, default=0.0)
    parser.add_argument("--y", type=float, default=0.0)
    parser.add_argument("--yaw", type=float, default=0.0)
    args = parser.parse_args()
    car = Car(args.x, args.y, args.yaw, args.speed)
    interfaces = {"autoware": Autoware, "dataspeed": Dataspeed}
    side = interfaces[args.interface](DomainParticipant(args.domain))
    closed = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), closed.set()), daemon=True).start()
    print("ready", flush=True)

    start, steps, timed_out = time.monotonic(), 0, False

    def tell():
        state = {"t": round(steps * STEP_S, 2), "engaged": side.engaged, "driver": side.driver}
        state |= {k: round(getattr(car, k), 3) for k in ("x", "y", "yaw", "speed", "steering", "accel")}
        state |= {"commands": side.commands, "refused": side.refused, "timeouts": side.timeouts}
        print(json.dumps(state), flush=True)

    while steps * STEP_S < args.seconds and not closed.is_set():
        t = steps * STEP_S
        if t >= args.driver_at:
            side.driver, side.engaged = True, False
        side.read(car, t)
        if side.engaged and t - side.newest > COMMAND_TIMEOUT_S:
            side.timeouts += not timed_out
            timed_out, car.wanted_accel = True, -TIMEOUT_BRAKE_MPS2
        else:
            timed_out = False
        if not side.engaged:
            car.wanted_accel = 0.0
        car.step(STEP_S)
        if t < args.silent_after:
            side.write(car, now_stamp())
        if steps % 50 == 0:
            tell()
        steps += 1
        time.sleep(max(0.0, start + steps * STEP_S - time.monotonic()))
    tell()


if __name__ == "__main__":
    main()
