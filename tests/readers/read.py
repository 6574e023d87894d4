"""Reads a log with MCAP's Python libraries: every message of every channel, and what it says against the record.

    python read.py LOG [CONFIG.json]

CONFIG.json says what the run's sensors were: {"cameras": {NAME: {"width_px", "height_px", "fov_deg"}}}.
Prints one line per channel and ends with a failed assertion where something is not as it should be.
"""

import io
import json
import math
import sys
from collections import defaultdict

import cbor2
import numpy as np
from google.protobuf import json_format
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from PIL import Image


def decoded(path):
    """The messages of each topic: (schema name, log time in ns, content)."""
    topics, factory, decoders = defaultdict(list), DecoderFactory(), {}
    with open(path, "rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            if channel.message_encoding == "cbor":
                content = cbor2.loads(message.data)
            else:
                assert channel.message_encoding == "protobuf", (channel.topic, channel.message_encoding)
                if channel.id not in decoders:
                    decoders[channel.id] = factory.decoder_for("protobuf", schema)
                content = decoders[channel.id](message.data)
                json_format.MessageToDict(content)  # every field of every part is what its schema says
            topics[channel.topic].append((schema.name, message.log_time, content))
    return topics


def seconds(stamp):
    """A protobuf time in seconds; the client gives datetimes or the message."""
    return stamp.seconds + stamp.nanos * 1e-9


def matrix(translation, rotation):
    """The 4 x 4 matrix of a transform; the rotation has to be one."""
    q = np.array([rotation.w, rotation.x, rotation.y, rotation.z])
    assert abs(np.linalg.norm(q) - 1) < 1e-9, q
    w, x, y, z = q
    m = np.eye(4)
    m[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    m[:3, 3] = [translation.x, translation.y, translation.z]
    assert np.allclose(m @ np.linalg.inv(m), np.eye(4), atol=1e-9)
    return m


class Frames:
    """Where everything is: the transforms of all topics."""

    def __init__(self, topics):
        self.of = defaultdict(list)
        for messages in topics.values():
            for name, _, content in messages:
                if name == "foxglove.FrameTransforms":
                    for t in content.transforms:
                        at = (t.parent_frame_id, matrix(t.translation, t.rotation))
                        self.of[t.child_frame_id].append((seconds(t.timestamp), *at))

    def to_map(self, frame, at_s):
        m = np.eye(4)
        while frame != "map":
            assert frame in self.of, f"nothing leads from {frame} to the map"
            times = self.of[frame]
            _, parent, step = min(times, key=lambda t: abs(t[0] - at_s))
            m, frame = step @ m, parent
        return m


def worlds(topics):
    return {record["header"]["stamp"]: record["payload"] for _, _, record in topics["/world"]}


def check_ego(topics, frames, world):
    """The ego's frame is where the record has it."""
    n = 0
    for at_s, parent, m in frames.of["ego"]:
        truth = world[round(at_s * 1e9)]["ego"]["state"]["pose"]
        assert parent == "map"
        assert np.allclose(m[:2, 3], [truth["x_m"], truth["y_m"]], atol=1e-6), (m, truth)
        yaw = math.atan2(m[1, 0], m[0, 0])
        assert abs(math.remainder(yaw - truth["heading_rad"], 2 * math.pi)) < 1e-3
        n += 1
    assert n > 10, n


def check_actors(topics, world):
    """The boxes stand where the record has the actors."""
    n = 0
    for _, _, update in topics["/view/actors"]:
        for entity in update.entities:
            truth = world[round(seconds(entity.timestamp) * 1e9)]["actors"]
            actor = next(a for a in truth if entity.id == f"actor {a['id']}")
            box, = entity.cubes
            position, size, pose, extent = box.pose.position, box.size, actor["pose"], actor["extent"]
            assert np.allclose([position.x, position.y], [pose["x_m"], pose["y_m"]], atol=1e-9)
            assert abs(position.z - actor["z_m"] - 0.5 * extent["height_m"]) < 1e-9
            assert [size.x, size.y, size.z] == [extent[k] for k in ("length_m", "width_m", "height_m")]
            yaw = 2 * math.atan2(box.pose.orientation.z, box.pose.orientation.w)
            assert abs(math.remainder(yaw - pose["heading_rad"], 2 * math.pi)) < 1e-9
            n += 1
    assert n > 0, "no actor was shown"


def check_plan(topics):
    """The plan's line has the points of the plan."""
    plans = {r["header"]["visible_at"]: r["payload"]["points"] for _, _, r in topics["/planner"]}
    for _, at, update in topics["/view/plan"]:
        line = update.entities[0].lines[0]
        assert [(p.x, p.y) for p in line.points] == [(p["pose"]["x_m"], p["pose"]["y_m"]) for p in plans[at]]


def check_clouds(topics, expected):
    """As many points as the record says it has fingerprints of, in order, at finite places."""
    for topic, messages in topics.items():
        for name, _, cloud in messages:
            if name != "foxglove.PointCloud":
                continue
            types = {1: "u1", 3: "<u2", 7: "<f4"}
            form = np.dtype({
                "names": [f.name for f in cloud.fields],
                "formats": [types[f.type] for f in cloud.fields],
                "offsets": [f.offset for f in cloud.fields],
                "itemsize": cloud.point_stride,
            })
            points = np.frombuffer(cloud.data, dtype=form)
            assert len(points) * cloud.point_stride == len(cloud.data)
            places = np.stack([points[axis] for axis in "xyz"], axis=1)
            assert np.isfinite(places).all(), topic
            least = expected.get(topic, {}).get("points_min", 0)
            assert len(points) >= least, (topic, len(points), least)
            if "ring" in form.names:
                assert points["ring"].max() < expected.get(topic, {}).get("rings", 1 << 16), topic
                assert (np.linalg.norm(places, axis=1) < 400).all()
        if any(name == "foxglove.PointCloud" for name, _, _ in messages) and "/scan" not in topic:
            sensor = topic.removeprefix("/view/").removesuffix("/points")
            record = topics.get(f"/{sensor}.points") or topics.get(f"/{sensor}.scan")
            assert len(record) == len(messages), (topic, len(record), len(messages))


def check_ground(topics, frames, world):
    """Points of a lidar in the map: the lowest lie on the ground."""
    for topic, messages in topics.items():
        for name, _, cloud in messages:
            if name != "foxglove.PointCloud" or not any(f.name == "ring" for f in cloud.fields):
                continue
            data = np.frombuffer(cloud.data, dtype=np.uint8).reshape(-1, cloud.point_stride)
            places = data[:, :12].copy().view("<f4").astype(float)
            m = frames.to_map(cloud.frame_id, seconds(cloud.timestamp))
            heights = places @ m[2, :3] + m[2, 3]
            ground = np.quantile(heights, 0.2)
            assert abs(ground) < 0.3, (topic, ground)


def check_cameras(topics, frames, cameras):
    """Images of the configured size; calibration as configured; boxes drawn where the record puts the actors."""
    for camera, wanted in cameras.items():
        images = topics[f"/view/{camera}/image"]
        calibrations = topics[f"/view/{camera}/calibration"]
        annotations = topics[f"/view/{camera}/annotations"]
        assert len(images) == len(calibrations) == len(annotations) > 0, camera
        assert len(images) == len(topics[f"/{camera}.rgb"]), camera
        size = (wanted["width_px"], wanted["height_px"])
        focal = 0.5 * size[0] / math.tan(math.radians(wanted["fov_deg"]) / 2)
        for (_, _, image), (_, _, calibration), (_, _, drawn) in zip(images, calibrations, annotations):
            picture = Image.open(io.BytesIO(image.data))
            picture.load()
            assert (picture.format.lower(), picture.size, picture.mode) == (image.format, size, "RGB")
            assert np.asarray(picture).std() > 5, f"{camera}: nothing is seen"
            at_s = seconds(image.timestamp)
            assert at_s == seconds(calibration.timestamp) == seconds(drawn.timestamp)
            assert image.frame_id == calibration.frame_id == f"ego/{camera}"
            assert (calibration.width, calibration.height) == size
            k = np.array(calibration.K).reshape(3, 3)
            assert np.allclose(k, [[focal, 0, size[0] / 2], [0, focal, size[1] / 2], [0, 0, 1]]), k
            assert np.allclose(np.array(calibration.P).reshape(3, 4)[:, :3], k)
            assert list(calibration.R) == [1, 0, 0, 0, 1, 0, 0, 0, 1]
            for points in drawn.points:
                assert all(-1e-6 <= p.x <= size[0] + 1e-6 for p in points.points), camera
                assert all(-1e-6 <= p.y <= size[1] + 1e-6 for p in points.points), camera


def check_annotations(topics, frames, world, cameras):
    """The middle of an actor as the camera sees it lies in the box that was drawn for one."""
    hits = 0
    for camera in cameras:
        for (_, _, drawn), (_, _, calibration) in zip(
            topics[f"/view/{camera}/annotations"], topics[f"/view/{camera}/calibration"]
        ):
            at_s = seconds(drawn.timestamp)
            camera_from_map = np.linalg.inv(frames.to_map(f"ego/{camera}", at_s))
            k = np.array(calibration.K).reshape(3, 3)
            state = world[min(world, key=lambda stamp: abs(stamp - at_s * 1e9))]
            boxes = []
            for points in drawn.points:
                xs, ys = [p.x for p in points.points], [p.y for p in points.points]
                boxes.append((min(xs), max(xs), min(ys), max(ys)))
            for actor in state["actors"]:
                pose, extent = actor["pose"], actor["extent"]
                center = [pose["x_m"], pose["y_m"], actor["z_m"] + 0.5 * extent["height_m"], 1]
                seen = camera_from_map @ center
                if not 4 < seen[2] < 40:
                    continue
                u, v, _ = k @ seen[:3] / seen[2]
                if not (0 < u < calibration.width and 0 < v < calibration.height):
                    continue
                hits += any(a - 2 <= u <= b + 2 and c - 2 <= v <= d + 2 for a, b, c, d in boxes)
    return hits


def check_raw(topics):
    """Depth and classes have a number for each pixel."""
    depth = {"32FC1": ("<f4", 4), "mono8": ("u1", 1)}
    n = 0
    for messages in topics.values():
        for name, _, image in messages:
            if name == "foxglove.RawImage":
                kind, bytes_per_pixel = depth[image.encoding]
                assert image.step == image.width * bytes_per_pixel
                numbers = np.frombuffer(image.data, dtype=kind).reshape(image.height, image.width)
                if image.encoding == "32FC1":
                    assert (numbers > 0).all() and np.isfinite(numbers).any()
                else:
                    assert set(np.unique(numbers)) <= set(range(35)), np.unique(numbers)
                n += 1
    return n


def main():
    path = sys.argv[1]
    config = json.load(open(sys.argv[2])) if len(sys.argv) > 2 else {}
    cameras = config.get("cameras", {})
    topics = decoded(path)
    for topic, messages in sorted(topics.items()):
        print(f"{len(messages):6} {messages[0][0]:34} {topic}")
    frames, world = Frames(topics), worlds(topics)
    check_ego(topics, frames, world)
    check_actors(topics, world)
    check_plan(topics)
    check_clouds(topics, config.get("clouds", {}))
    check_ground(topics, frames, world)
    check_cameras(topics, frames, cameras)
    hits = check_annotations(topics, frames, world, cameras)
    assert hits >= config.get("annotations_min", 0), hits
    raw = check_raw(topics)
    assert raw >= config.get("raw_images_min", 0), raw
    for _, _, fix in topics.get("/view/gnss", []):
        assert -90 <= fix.latitude <= 90 and fix.position_covariance[0] >= 0
    messages = sum(map(len, topics.values()))
    print(f"{messages} messages of {len(topics)} channels read; {hits} actors within boxes, {raw} raw images")


main()
