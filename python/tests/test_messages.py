"""Messages: the dataclasses are what the Rust types are, and come back as they went."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import swerve
from swerve import _swerve, messages

ROOT = Path(__file__).resolve().parents[2]
# Every sensor that there is, and everything else that publishes.
CONFIG = {
    "log": {"sensors": ["gnss", "odometry", "collisions", "lane_invasions", "red_lights"]},
    "gate": {"enabled": True},
    "camera": {"front": {"width_px": 64, "height_px": 32, "period_ms": 500, "outputs": ["rgb", "depth", "semantic", "instance"]}},
    "lidar": {"roof": {"preset": "vlp_32"}},
    "radar": {"nose": {}},
    "monitor": {"eye": {"sensor": "front"}, "ear": {"sensor": "roof"}},
    "end": None,
}


@pytest.mark.skipif(not (ROOT / "crates").is_dir(), reason="the Rust types are not here")
def test_the_classes_are_what_the_rust_types_say() -> None:
    subprocess.run([sys.executable, ROOT / "python/tools/messages.py", "--check"], check=True)


@pytest.fixture(scope="module")
def all_streams() -> dict[str, swerve.Stream]:
    config = {key: value for key, value in CONFIG.items() if value is not None}
    config["log"] = {"sensors": [*CONFIG["log"]["sensors"], "front", "roof", "nose"]}  # type: ignore[index]
    images = ["front.rgb", "front.depth", "front.semantic", "front.instance", "roof.points"]
    everything = swerve.run("person_behind_truck", config).streams
    return everything | swerve.run("person_behind_truck", config, streams=images).streams


def test_every_message_comes_back_as_it_went(all_streams: dict[str, swerve.Stream]) -> None:
    kinds = set()
    for name, stream in all_streams.items():
        every = max(1, len(stream) // 10)
        for index in range(0, len(stream), every):
            plain = stream.plain(index)
            message = stream[index]
            kinds.add(type(message).__name__)
            assert [field.name for field in dataclasses.fields(message)] == list(plain), name
            assert message.to_plain() == plain, name
            assert _swerve.from_cbor(_swerve.to_cbor(message.to_plain())) == plain, name
    assert kinds >= {"WorldState", "EgoState", "PredictionList", "Plan", "GateOutput", "Image", "PointCloud", "RadarScan"}


def test_images_are_arrays(all_streams: dict[str, swerve.Stream]) -> None:
    shapes = {name: all_streams[f"front.{name}"][0].pixels for name in ("rgb", "depth", "semantic", "instance")}
    assert {name: (array.shape, array.dtype) for name, array in shapes.items()} == {
        "rgb": ((32, 64, 3), np.uint8),
        "depth": ((32, 64), np.float32),
        "semantic": ((32, 64), np.uint8),
        "instance": ((32, 64), np.uint32),
    }
    cloud = all_streams["roof.points"][0]
    assert len(cloud.x_m) == len(cloud.ring) > 100 and cloud.ring.dtype == np.uint16
    assert cloud.x_m.dtype == np.float32 and np.isfinite(cloud.x_m).all()


def test_kinds_of_values_are_told_apart() -> None:
    plain: Any = {"stopping": "released"}
    mode = messages.GateMode("stopping", messages.StopCause.RELEASED)
    output = messages.GateOutput.from_plain(
        {
            "mode": plain,
            "engaged": True,
            "command": {"stamp": 1, "steering_rad": 0.0, "speed_mps": 1.0, "accel_mps2": -1.0},
            "heartbeat": 7,
            "refused": None,
            "refusals": {"not_finite": 0, "out_of_order": 0, "stale": 1, "ahead": 0},
            "limited": False,
        }
    )
    assert output.mode == mode and output.to_plain()["mode"] == plain
    assert messages.GateMode("manual").value is None
