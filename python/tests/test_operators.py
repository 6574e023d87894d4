"""Operators in Python: in a process of a run, on the very memory that a sensor wrote."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Any

import pytest

import swerve
from swerve import messages, operators

SENSORS = {
    "camera": {"front": {"width_px": 320, "height_px": 160, "period_ms": 500}},
    "monitor": {"eye": {"sensor": "front"}},
    "log": {"sensors": ["front"]},
}


def with_worker(operator: str, where: str, **more: Any) -> dict[str, Any]:
    import sys

    start = [sys.executable, "-m", "swerve", "worker", where]
    return {**SENSORS, **more, "process": {"python": {"operators": [operator], "start": start}}}


@pytest.fixture
def file(tmp_path: Path) -> Any:
    def write(text: str) -> str:
        path = tmp_path / "operator_under_test.py"
        path.write_text("import numpy as np\nimport swerve\nfrom swerve import messages\n" + textwrap.dedent(text))
        return str(path)

    return write


def test_images_are_read_where_they_lie(file: Any) -> None:
    """The worker writes down where its array is, and which mapping of its memory that is in."""
    where = file(
        """
        class Eye(swerve.Operator):
            inputs = {"image": messages.Image}
            outputs = {"health": messages.SensorHealth}

            def step(self, frame):
                image = frame["image"]
                address = image.pixels.__array_interface__["data"][0]
                assert address == image.pixels.base.address, "another place than the block's"
                assert not image.pixels.flags.owndata and not image.pixels.flags.writeable
                mapping = next(
                    line for line in open("/proc/self/maps")
                    if int(line.split("-")[0], 16) <= address < int(line.split()[0].split("-")[1], 16)
                )
                assert "/dev/shm/" in mapping, mapping
                commonest = np.bincount(image.pixels.reshape(-1)).max() / image.pixels.size
                return messages.SensorHealth(image.stamp, image.pixels.size, 0, float(np.float32(commonest)), False, address)
        """
    )
    result = swerve.run("lane", with_worker("eye", f"{where}:Eye"), set={"ego.speed_mps": 30})
    health = list(result.streams["eye"])
    assert len(health) > 5 and {message.numbers for message in health} == {320 * 160 * 3}
    here = swerve.run("lane", SENSORS, set={"ego.speed_mps": 30})
    # 32-bit numbers of Rust, counted by somebody else.
    assert [m.commonest_share for m in health] == [m.commonest_share for m in here.streams["eye"]]


def test_a_run_comes_out_the_same_with_a_tracker_in_python(file: Any) -> None:
    """Passes on what the tracker of the stack would have made: same messages, same digest."""
    where = file(
        """
        class Tracker(swerve.Operator):
            inputs = {"obstacles": messages.ObstacleList}
            outputs = {"tracks": messages.TrackList}

            def __init__(self):
                self.past = {}

            def step(self, frame):
                seen = frame["obstacles"]
                tracks = []
                for o in seen.obstacles:
                    past = self.past.setdefault(o.id, [])
                    past.append(messages.Sighting(seen.stamp, messages.Point2(o.pose.x_m, o.pose.y_m)))
                    tracks.append(messages.Track(o.id, o.kind, o.pose, o.extent, o.velocity_mps, past[-10:]))
                return messages.TrackList(seen.stamp, tracks)
        """
    )
    result = swerve.run("person_crossing", with_worker("tracker", f"{where}:Tracker"))
    again = swerve.run("person_crossing", with_worker("tracker", f"{where}:Tracker"))
    assert result.digest == again.digest
    tracks = result.streams["tracker"]
    assert len(tracks) > 20 and sum(len(message.tracks) for message in tracks) > 0


def test_what_an_operator_raises_ends_the_run_with_its_name(file: Any) -> None:
    where = file(
        """
        class Eye(swerve.Operator):
            inputs = {"image": messages.Image}
            outputs = {"health": messages.SensorHealth}

            def step(self, frame):
                raise RuntimeError("boom")
        """
    )
    with pytest.raises(ValueError, match=r"(?s)operator `eye` panicked: RuntimeError: boom.*line \d+, in step"):
        swerve.run("lane", with_worker("eye", f"{where}:Eye"))


def test_ports_are_compared(file: Any, capfd: pytest.CaptureFixture[str]) -> None:
    where = file(
        """
        class Eye(swerve.Operator):
            inputs = {"image": messages.PointCloud}
            outputs = {"health": messages.SensorHealth}
        """
    )
    with pytest.raises(ValueError):
        swerve.run("lane", with_worker("eye", f"{where}:Eye"))
    said = capfd.readouterr().err
    assert "inputs of operator `eye` are (front.rgb: Image), the class declares (image: PointCloud)" in said


def test_an_operator_is_stepped_without_a_run() -> None:
    class Brake(operators.Operator):
        inputs = {"pose": messages.EgoState, "plan": messages.Plan}
        outputs = {"command": messages.Command}

        def step(self, frame: operators.Frame) -> messages.Command | None:
            pose = frame["pose"]
            return None if pose is None else messages.Command(0.0, 0.0, min(1.0, pose.speed_mps))

    ports = [("latest", "pose", "EgoState"), ("latest", "planner", "Plan")]
    step = operators.stepper(Brake(), "controller", ports, [("controller", "Command")])
    facts = {"operator": "controller", "now": 5, "stamp": 5, "deadline": None}
    assert step(facts, [[], []]) == []
    header = dict(stamp=5, visible_at=5, seq=0, watermark=5, reused_from=None, origin=None)
    pose = swerve.run("lane", streams=["pose"]).streams["pose"].plain(3)
    assert step(facts, [[(header, pose)], []]) == [{"steering_rad": 0.0, "throttle": 0.0, "brake": 1.0}]
