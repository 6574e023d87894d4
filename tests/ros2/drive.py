"""Another stack: drives a car over Autoware's topics: python3 drive.py DOMAIN SECONDS LANE_Y_M SPEED_MPS

Pure pursuit along the line y = LANE_Y_M at a speed, from /localization/kinematic_state to /control/command/control_cmd,
engaged by /autoware/engage. After so many seconds of driving it falls silent, and looks on. Prints `ready`, and one
JSON object at the end, when standard input is closed: the car's way and who drove by its reports.
"""

import json
import math
import sys
import threading
import time

from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from ros_types import ros

WHEELBASE_M, LOOK_AHEAD_M, GAIN_PER_S, ACCEL_MAX_MPS2 = 2.85, 8.0, 1.0, 2.0
RELIABLE = Policy.Reliability.Reliable(10**8)
NEWEST = Qos(RELIABLE, Policy.Durability.Volatile, Policy.History.KeepLast(1))


def sound(reader):
    return [sample for sample in reader.take(N=10) if sample.sample_info.valid_data]


def main():
    domain, seconds, lane, wanted = int(sys.argv[1]), *map(float, sys.argv[2:5])
    participant = DomainParticipant(domain)

    def topic(name, kind):
        return Topic(participant, f"rt{name}", ros(kind), qos=NEWEST)

    odometry = DataReader(participant, topic("/localization/kinematic_state", "nav_msgs/Odometry"), qos=NEWEST)
    modes = DataReader(
        participant, topic("/vehicle/status/control_mode", "autoware_vehicle_msgs/ControlModeReport"), qos=NEWEST
    )
    control_type, engage_type = ros("autoware_control_msgs/Control"), ros("autoware_vehicle_msgs/Engage")
    controls = DataWriter(participant, topic("/control/command/control_cmd", "autoware_control_msgs/Control"), qos=NEWEST)
    engages = DataWriter(participant, topic("/autoware/engage", "autoware_vehicle_msgs/Engage"), qos=NEWEST)
    closed = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), closed.set()), daemon=True).start()
    print("ready", flush=True)

    began, mode, way = None, None, []
    told = {"autonomous": 0, "manual": 0}
    while not closed.is_set():
        for report in sound(modes):
            mode = report.mode
            told["autonomous" if mode == 1 else "manual"] += 1
        for message in sound(odometry):
            now = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
            x, y = message.pose.pose.position.x, message.pose.pose.position.y
            q = message.pose.pose.orientation
            yaw, speed = 2.0 * math.atan2(q.z, q.w), message.twist.twist.linear.x
            way.append([round(v, 3) for v in (now, x, y, yaw, speed)])
            if mode == 1 and began is None:
                began = now
            if began is not None and now - began > seconds:
                continue
            ahead = math.atan2(lane - y, LOOK_AHEAD_M) - yaw
            control = control_type(stamp=message.header.stamp)
            control.lateral.steering_tire_angle = math.atan(2.0 * WHEELBASE_M * math.sin(ahead) / LOOK_AHEAD_M)
            control.longitudinal.velocity = wanted
            accel = GAIN_PER_S * (wanted - speed)
            control.longitudinal.acceleration = max(-ACCEL_MAX_MPS2, min(ACCEL_MAX_MPS2, accel))
            control.longitudinal.is_defined_acceleration = True
            controls.write(control)
            if mode != 1:
                engages.write(engage_type(stamp=message.header.stamp, engage=True))
        time.sleep(0.005)
    print(json.dumps({"began_s": began, "way": way, **told}), flush=True)


main()
