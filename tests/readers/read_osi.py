"""Reads the ground truth of OSI in a log with ASAM's own classes and reader, and compares it with the record.

    python read_osi.py LOG

Each message is decoded twice: with the classes of `osi-python`, and with the schema in the log. Every field has to be known to
both. Prints the number of messages and objects, and ends with a failed assertion where something differs.
"""

import math
import sys
from pathlib import Path

import cbor2
from google.protobuf import json_format
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from osi3.osi_groundtruth_pb2 import GroundTruth
from osi3.osi_object_pb2 import MovingObject
from osi_utilities.tracefile.readers.multi import MultiTraceReader

TOPIC = "/osi/ground_truth"
CLASSES = MovingObject.VehicleClassification
KINDS = {
    "car": (MovingObject.TYPE_VEHICLE, CLASSES.TYPE_CAR),
    "truck": (MovingObject.TYPE_VEHICLE, CLASSES.TYPE_HEAVY_TRUCK),
    "motorcycle": (MovingObject.TYPE_VEHICLE, CLASSES.TYPE_MOTORCYCLE),
    "cyclist": (MovingObject.TYPE_VEHICLE, CLASSES.TYPE_BICYCLE),
    "pedestrian": (MovingObject.TYPE_PEDESTRIAN, CLASSES.TYPE_UNKNOWN),
}


def decoded(path):
    """Messages of the topic, decoded by both, with their log times; and the states of the world by stamp."""
    found, world, factory = [], {}, DecoderFactory()
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        for schema, channel, message in reader.iter_messages():
            if channel.topic == TOPIC:
                assert (schema.name, schema.encoding) == ("osi3.GroundTruth", "protobuf"), schema
                known = GroundTruth.FromString(message.data)
                own = factory.decoder_for("protobuf", schema)(message.data)
                # Unknown fields would be left out of one of them.
                as_names = tuple(json_format.MessageToDict(one, use_integers_for_enums=True) for one in (known, own))
                assert as_names[0] == as_names[1], as_names
                assert known.SerializeToString(deterministic=True) == message.data, "an unknown or unordered field"
                found.append((message.log_time, known))
            elif channel.topic == "/world":
                record = cbor2.loads(message.data)
                world[record["header"]["stamp"]] = record["payload"]
        metadata = {one.name: one.metadata for one in reader.iter_metadata()}
        channels = [one for one in reader.get_summary().channels.values() if one.topic == TOPIC]
    assert metadata["net.asam.osi.trace"]["version"] == "3.8.0", metadata.keys()
    assert [one.metadata["net.asam.osi.trace.channel.osi_version"] for one in channels] == ["3.8.0"]
    return found, world


def near(a, b, most=1e-9):
    return all(abs(x - y) <= most for x, y in zip(a, b, strict=True))


def xyz(vector):
    return vector.x, vector.y, vector.z


def check_actor(one, actor):
    """An object has the pose, box, velocity and kind of the actor in the record."""
    pose, extent, velocity = actor["pose"], actor["extent"], actor["velocity_mps"]
    base = one.base
    size = base.dimension.length, base.dimension.width, base.dimension.height
    assert near(size, (extent["length_m"], extent["width_m"], extent["height_m"]))
    assert near(xyz(base.position), (pose["x_m"], pose["y_m"], actor["z_m"] + 0.5 * extent["height_m"]))
    assert near([base.orientation.yaw], [pose["heading_rad"]])
    if actor["kind"] != "static":
        assert near(xyz(base.velocity), (velocity["x"], velocity["y"], 0.0))
        assert (one.type, one.vehicle_classification.type) == KINDS[actor["kind"]], one


def check_ego(host, ego):
    """The rear axle, from the centre of the box, is where the record has the ego."""
    base, state, to_rear = host.base, ego["state"], host.vehicle_attributes.bbcenter_to_rear
    yaw, pitch = base.orientation.yaw, base.orientation.pitch
    assert abs(math.remainder(yaw - state["pose"]["heading_rad"], math.tau)) < 1e-3
    x = base.position.x + math.cos(yaw) * (math.cos(pitch) * to_rear.x + math.sin(pitch) * to_rear.z)
    y = base.position.y + math.sin(yaw) * (math.cos(pitch) * to_rear.x + math.sin(pitch) * to_rear.z)
    # The record has the point of the axle on the ground; a roll of 3 degrees moves it by 4 cm.
    assert math.hypot(x - state["pose"]["x_m"], y - state["pose"]["y_m"]) < 0.1
    # Along the heading, every point of the car is as fast.
    forward = base.velocity.x * math.cos(yaw) + base.velocity.y * math.sin(yaw)
    assert abs(forward - state["speed_mps"]) < 0.1 + 0.01 * abs(state["speed_mps"]), (forward, state)


def check_motion(messages):
    """Accelerations are those of the velocities, and velocities those of the positions, of the ego."""
    for (_, before), (_, now) in zip(messages, messages[1:]):
        (old, new), dt = (before.moving_object[0].base, now.moving_object[0].base), seconds(now) - seconds(before)
        gained = [(b - a) / dt for a, b in zip(xyz(old.velocity), xyz(new.velocity))]
        assert near(gained, xyz(new.acceleration), 1e-6), (gained, new.acceleration)
        moved = [(b - a) / dt for a, b in zip(xyz(old.position), xyz(new.position))]
        assert near(moved, xyz(new.velocity), 0.2), (moved, new.velocity)


def seconds(truth):
    return truth.timestamp.seconds + truth.timestamp.nanos * 1e-9


def main():
    messages, world = decoded(sys.argv[1])
    # ASAM's reader of trace files finds the same messages.
    reader = MultiTraceReader(skip_incompatible_messages=False)
    assert reader.open(Path(sys.argv[1]))
    reader.set_topics([TOPIC])
    read = []
    while (result := reader.read_message()) is not None:
        assert result.message is not None, result
        read.append(result.message)
    assert read == [truth for _, truth in messages]
    stamps = [round(seconds(truth) * 1e9) for _, truth in messages]
    assert stamps == sorted(world), "a message for each state of the world"
    objects = 0
    for k, (stamp, (_, truth)) in enumerate(zip(stamps, messages)):
        actors = {actor["id"]: actor for actor in world[stamp]["actors"]}
        host, *moving = truth.moving_object
        assert host.id == truth.host_vehicle_id and host.id.value == world[stamp]["ego"]["id"]
        check_ego(host, world[stamp]["ego"])
        others = [*moving, *truth.stationary_object]
        assert sorted(one.id.value for one in others) == sorted(actors)
        for one in others:
            check_actor(one, actors[one.id.value])
        ids = [one.id.value for kind in (truth.moving_object, truth.stationary_object, truth.traffic_light,
                                         truth.lane, truth.lane_boundary) for one in kind]
        assert len(set(ids)) == len(ids)
        assert bool(truth.lane) == bool(truth.lane_boundary) == (k == 0)
        objects += 1 + len(others)
    first = messages[0][1]
    boundaries = {one.id.value for one in first.lane_boundary}
    for lane in first.lane:
        named = [*lane.classification.left_lane_boundary_id, *lane.classification.right_lane_boundary_id]
        assert {one.value for one in named} <= boundaries and len(named) >= 2
    check_motion(messages)
    lit = {tuple(lamp.classification.mode for lamp in truth.traffic_light) for _, truth in messages}
    print(f"{len(messages)} messages, {objects} objects, {len(first.lane)} lanes, {len(lit)} states of traffic lights")


main()
