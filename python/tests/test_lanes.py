"""The lanes of a road or map, and operators that read them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import swerve

STRAIGHT: dict[str, Any] = {
    "name": "straight",
    "description": "A straight road with two lanes.",
    "road": {"segments": [{"length_m": 200.0}], "lane_width_m": 4.0, "left_m": 6.0, "right_m": 2.0},
    "ego": {"target_speed_mps": 8.0, "end_m": 100.0},
    "end": {"timeout_s": 1.0},
    "expect": {"verdict": "timeout"},
}


def test_lanes_of_a_map_refer_to_each_other() -> None:
    lanes = swerve.read_map("maps/right_before_left")
    assert len(lanes) > 12 and list(lanes) == sorted(lanes)
    driving = [lane for lane in lanes.values() if lane.kind == "driving"]
    assert any(lane.in_junction for lane in driving) and any(lane.speed_limit_mps for lane in driving)
    for lane in driving:
        assert lane.s_m[0] == 0.0 and (np.diff(lane.s_m) > 0.0).all()
        for following in (lanes[successor] for successor in lane.successors):
            assert lane.id in following.predecessors
            assert np.hypot(following.x_m[0] - lane.x_m[-1], following.y_m[0] - lane.y_m[-1]) < 0.1
        for beside in (lane.left, lane.right):
            if beside:
                back = lanes[beside.lane]
                assert lane.id in [side.lane for side in (back.left, back.right) if side]


def test_a_place_is_found_from_a_point_and_back() -> None:
    lanes = swerve.read_map("maps/right_before_left")
    for lane in (lane for lane in lanes.values() if lane.kind == "driving"):
        middle = float(lane.s_m[-1]) / 2.0
        columns = (lane.x_m, lane.y_m, np.unwrap(lane.heading_rad))
        x, y, heading = (float(np.interp(middle, lane.s_m, column)) for column in columns)
        point = (x - 0.1 * np.sin(heading), y + 0.1 * np.cos(heading))
        if not lane.in_junction:  # there, lanes lie on each other
            assert lanes.nearest(*point).lane == lane.id
        found = [place for place in lanes.at(*point) if place.lane == lane.id]
        assert len(found) == 1 and found[0].s_m == pytest.approx(middle, abs=0.2)
        assert found[0].d_m == pytest.approx(0.1, abs=0.05)
    assert lanes.at(1e4, 0.0) == []


def test_a_road_without_a_map_has_lanes_too_and_unknown_ones_are_key_errors() -> None:
    lanes = swerve.read_map(STRAIGHT)
    place = lanes.nearest(50.0, 0.5)
    assert (place.s_m, place.d_m) == (50.0, 0.5)
    lane = lanes[place.lane]
    assert (lane.left_m == 2.0).all() and (lane.right_m == 2.0).all()
    assert lane.left is not None and lane.left.lane in lanes
    with pytest.raises(KeyError):
        lanes[999]
    with pytest.raises(ValueError, match="no_such"):
        swerve.read_map("no_such")


def test_an_operator_has_the_lanes_of_its_run(tmp_path: Path) -> None:
    (tmp_path / "shut.py").write_text(
        """
import swerve
from swerve.messages import Closures, EgoState, Stop

class Shut(swerve.Operator):
    inputs = {"ego": EgoState}
    outputs = {"closures": Closures}

    def step(self, frame):
        pose = frame["ego"].pose
        place = self.map.nearest(pose.x_m, pose.y_m)
        return Closures(frame.stamp, [Stop(place.lane, place.s_m)])
"""
    )
    config = {
        "operator": {
            "shut": {"kind": "python", "inputs": {"ego": "EgoState"}, "outputs": {"closures": "Closures"}},
            "router": {"reads": {"closures": {"stream": "shut", "feedback": True}}},
        },
        "process": {"shut": {"operators": ["shut"], "python": f"{tmp_path / 'shut.py'}:Shut"}},
    }
    result = swerve.run(STRAIGHT, config)
    reports = list(result.streams["shut"])
    assert len(reports) > 50
    poses = {pose.stamp: pose.pose for pose in result.streams["pose"]}
    assert all(report.places[0].s_m == pytest.approx(poses[report.stamp].x_m) for report in reports)
