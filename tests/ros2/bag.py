"""Writes rosbag2 logs in MCAP form with a maker's library that is not ours, messages encoded by Cyclone DDS.

    python3 bag.py drive FILE none|lz4|zstd SECONDS     # a car that drives a straight lane at 8 m/s, made up
    python3 bag.py record FILE none|lz4|zstd DOMAIN     # what is said on topics, until standard input is closed

`drive`: reports at 50 Hz, whose clock is 1.5 s behind the recorder's, two things beside the road, and among them what
should trouble nobody: a topic that nobody asks for, a topic of another type, bytes that are no message, a stamp from
long ago. `record`: topics come on standard input, one `TOPIC PACKAGE/NAME` a line, until an empty line; it prints
`ready`, and at its end how many messages it wrote.
"""

import math
import sys
import threading
import time

from mcap.writer import CompressionType, Writer

from ros_types import ros

COMPRESSIONS = {"none": CompressionType.NONE, "lz4": CompressionType.LZ4, "zstd": CompressionType.ZSTD}


class Bag:
    def __init__(self, path, compression):
        self.file = open(path, "wb")
        self.writer = Writer(self.file, chunk_size=64 * 1024, compression=COMPRESSIONS[compression])
        self.writer.start(profile="ros2", library="swerve test")
        self.channels, self.count = {}, 0

    def add(self, topic, name, log_ns, message):
        """`message` is one of ros_types', or bytes."""
        if topic not in self.channels:
            package, kind = name.split("/")
            schema = self.writer.register_schema(f"{package}/msg/{kind}", "ros2msg", b"")
            metadata = {"offered_qos_profiles": ""}
            self.channels[topic] = self.writer.register_channel(topic, "cdr", schema, metadata)
        data = message if isinstance(message, bytes) else message.serialize(use_version_2=False)
        self.writer.add_message(self.channels[topic], log_ns, bytes(data), log_ns, self.count)
        self.count += 1

    def finish(self):
        self.writer.finish()
        self.file.close()


def stamp(ns):
    return ros("builtin_interfaces/Time")(sec=ns // 10**9, nanosec=ns % 10**9)


def drive(bag, seconds):
    begin, behind = 1_700_000_000_000_000_000, 1_500_000_000
    for i in range(int(50 * seconds)):
        log = begin + i * 20_000_000 + (i * 7 % 5) * 1_000_000
        now = stamp(begin + i * 20_000_000 - behind)
        x, y = 0.16 * i, 0.3 * math.sin(0.02 * i)
        odometry = ros("nav_msgs/Odometry")(child_frame_id="base_link")
        odometry.header.stamp, odometry.header.frame_id = now, "map"
        odometry.pose.pose.position.x, odometry.pose.pose.position.y = x, y
        odometry.pose.pose.orientation.w, odometry.twist.twist.linear.x = 1.0, 8.0
        bag.add("/localization/kinematic_state", "nav_msgs/Odometry", log, odometry)
        velocity = ros("autoware_vehicle_msgs/VelocityReport")(longitudinal_velocity=8.0)
        velocity.header.stamp, velocity.header.frame_id = now, "base_link"
        bag.add("/vehicle/status/velocity_status", "autoware_vehicle_msgs/VelocityReport", log, velocity)
        steering = ros("autoware_vehicle_msgs/SteeringReport")(stamp=now, steering_tire_angle=0.01)
        bag.add("/vehicle/status/steering_status", "autoware_vehicle_msgs/SteeringReport", log, steering)
        mode = ros("autoware_vehicle_msgs/ControlModeReport")(stamp=now, mode=1)
        bag.add("/vehicle/status/control_mode", "autoware_vehicle_msgs/ControlModeReport", log, mode)
        if i % 5 == 0:
            objects = ros("autoware_perception_msgs/PredictedObjects")()
            objects.header.stamp, objects.header.frame_id = now, "map"
            for k, (ox, oy) in enumerate(((80.0, 6.0), (120.0, -5.0))):
                one = ros("autoware_perception_msgs/PredictedObject")(existence_probability=1.0)
                one.object_id.uuid[0] = k + 1
                kind = ros("autoware_perception_msgs/ObjectClassification")(label=1, probability=1.0)
                one.classification.append(kind)
                pose = one.kinematics.initial_pose_with_covariance.pose
                pose.position.x, pose.position.y, pose.orientation.w = ox, oy, 1.0
                size = one.shape.dimensions
                size.x, size.y, size.z = 4.5, 1.8, 1.5
                objects.objects.append(one)
            topic = "/perception/object_recognition/objects"
            bag.add(topic, "autoware_perception_msgs/PredictedObjects", log, objects)
        if i % 50 == 10:
            bag.add("/weather", "std_msgs/Bool", log, ros("std_msgs/Bool")(data=True))
            bag.add("/sensing/imu/imu_raw", "nav_msgs/Odometry", log, odometry)
            bag.add("/vehicle/status/steering_status", "autoware_vehicle_msgs/SteeringReport", log, b"\0\1\0\0xyz")
            velocity.header.stamp = stamp(begin - 10**12)
            bag.add("/vehicle/status/velocity_status", "autoware_vehicle_msgs/VelocityReport", log, velocity)


def record(bag, domain):
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.qos import Policy, Qos
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic

    participant, readers = DomainParticipant(domain), []
    qos = Qos(Policy.Reliability.BestEffort, Policy.Durability.Volatile, Policy.History.KeepLast(100))
    for line in iter(sys.stdin.readline, "\n"):
        if not line.strip():
            break
        topic, name = line.split()
        dds_topic = Topic(participant, f"rt{topic}", ros(name), qos=qos)
        readers.append((topic, name, DataReader(participant, dds_topic, qos=qos)))
    closed = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), closed.set()), daemon=True).start()
    print("ready", flush=True)
    while not closed.is_set():
        for topic, name, reader in readers:
            for sample in reader.take(N=100):
                if sample.sample_info.valid_data:
                    bag.add(topic, name, time.time_ns(), sample)
        time.sleep(0.002)


def main():
    what, path, compression, argument = sys.argv[1:5]
    bag = Bag(path, compression)
    drive(bag, float(argument)) if what == "drive" else record(bag, int(argument))
    bag.finish()
    print(bag.count, flush=True)


main()
