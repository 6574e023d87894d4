"""Worlds in Python, and what classes in Python get at the start of a drive."""

from __future__ import annotations

import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import pytest

import swerve

#: A car on a straight, kinematic, behind another one that brakes from `brake_at_s` on.
WORLD = """
    import math
    from swerve.messages import ActorKind, EgoState, Extent, Obstacle, ObstacleList, Pose2, Vector2

    class Straight(swerve.World):
        sensors = {"obstacles": ObstacleList}

        def reset(self, start):
            assert start.map and len(start.route.s_m) > 50 and start.shape.length_m > 4.0
            self.keys = start.read_keys(brake_at_s=3.0, gap_m=30.0, least_mps=8.0)
            self.step_s = start.step_ns * 1e-9
            self.ego = EgoState(0, start.pose, start.speed_mps, 0.0, 0.0, 0.0, 0.0)
            self.lead_m, self.lead_mps = start.pose.x_m + self.keys.gap_m, start.speed_mps
            return self.scene()

        def step(self, command, dt_ns):
            t = dt_ns * 1e-9
            ego, accel = self.ego, 3.0 * command.throttle - 8.0 * command.brake
            speed = max(0.0, ego.speed_mps + accel * t)
            yaw = speed * math.tan(command.steering_rad) / 2.9
            pose = Pose2(ego.pose.x_m + speed * t * math.cos(ego.pose.heading_rad),
                         ego.pose.y_m + speed * t * math.sin(ego.pose.heading_rad), ego.pose.heading_rad + yaw * t)
            self.ego = EgoState(self.now, pose, speed, accel, speed * yaw, yaw, command.steering_rad)
            if self.now * 1e-9 > self.keys.brake_at_s:
                self.lead_mps = max(self.keys.least_mps, self.lead_mps - 8.0 * t)
            self.lead_m += self.lead_mps * t
            return self.scene()

        def scene(self):
            lead = Obstacle(1, ActorKind.CAR, Pose2(self.lead_m, 0.0, 0.0), Extent(4.5, 1.9, 1.5), Vector2(self.lead_mps, 0.0), 1.0)
            self.others = [lead]
            return swerve.Scene(self.ego, self.others)

        def observe(self, name):
            assert name == "obstacles"
            return ObstacleList(self.now, self.others)
"""

ROAD = {
    "name": "straight",
    "road": {"segments": [{"length_m": 400.0}], "lane_width_m": 4.0, "left_m": 2.0, "right_m": 2.0},
    "ego": {"target_speed_mps": 15.0, "end_m": 250.0},
    "end": {"timeout_s": 40.0, "after_collision_s": 0.5},
    "expect": {"verdict": "avoided"},
}


@pytest.fixture
def file(tmp_path: Path) -> Any:
    def write(text: str, name: str = "world_under_test.py") -> str:
        path = tmp_path / name
        path.write_text("import numpy as np\nimport swerve\nfrom swerve import messages\n" + textwrap.dedent(text))
        return str(path)

    return write


def of_world(where: str, *, late_ms: float = 0.0, **keys: Any) -> dict[str, Any]:
    sensor = {"kind": "python_sensor", "message": "ObstacleList", "period_ms": 100.0}
    operators = {"world": {"kind": "python_world"}, "obstacles": sensor}
    planner = {"planner": {"runtime": {"fixed_ms": late_ms}}} if late_ms else {}
    process = {"operators": ["world", "obstacles"], "python": where, "keys": keys}
    return {"operator": {**operators, **planner}, "process": {"world": process}}


def says(*words: object) -> str:
    command = [sys.executable, "-m", "swerve", *map(str, words)]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run
    return run.stdout


def test_world_in_python_is_driven_logged_and_replayed(file: Any, tmp_path: Path) -> None:
    where, log = f"{file(WORLD)}:Straight", tmp_path / "drive.mcap"
    result = swerve.run(ROAD, of_world(where), log=log)
    assert result.verdict == "avoided" and result.metrics["min_distance_m"] > 0.2
    again = swerve.run(ROAD, of_world(where), threads=2)
    assert again.digest == result.digest
    assert swerve.run(ROAD, of_world(where, gap_m=40.0)).digest != result.digest
    # A sensor is an origin: commands have response times.
    seen, plans = result.streams["obstacles"], result.streams["planner"]
    assert (seen.stamps % 100_000_000 == 0).all() and set(plans.origins.tolist()) <= set(seen.stamps.tolist())
    assert result.metrics["response"]["count"] > 10
    # The end of the world ends the run.
    assert result.streams["world"]["ended"][-1] == "stopped" or result.streams["world"].stamps[-1] < 40_000_000_000
    assert f"digest {result.digest}, as logged" in says("replay", log, "--verify", "--allow-code")


def test_why_drives_the_world_in_python_again(file: Any, tmp_path: Path) -> None:
    log = tmp_path / "drive.mcap"
    result = swerve.run(ROAD, of_world(f"{file(WORLD)}:Straight", late_ms=900.0, gap_m=12.0, least_mps=0.0), log=log)
    assert result.verdict == "collision", result.metrics
    assert result.streams["world"]["ended"][-1] == "collision"
    assert "a plan changed because of it" in result.metrics["why"]["sentence"], result.metrics["why"]
    allowed = says("why", log, "--allow-code")
    assert "effect" in allowed and "cannot be computed" not in allowed, allowed
    refused = says("why", log)
    assert "how the car would have driven without it cannot be computed" in refused, refused


def test_study_varies_the_keys_of_a_world(file: Any) -> None:
    axis = {"key": "process.world.keys.gap_m", "values": [12.0, 60.0]}
    config = Path(file("", "config.toml")).with_name("w.toml")
    where = file(WORLD)
    text = f"""
        [operator.world]
        kind = "python_world"
        [operator.obstacles]
        kind = "python_sensor"
        message = "ObstacleList"
        period_ms = 100.0
        [operator.planner]
        runtime = {{ fixed_ms = 900.0 }}
        [process.world]
        operators = ["world", "obstacles"]
        python = "{where}:Straight"
        keys = {{ least_mps = 0.0, brake_at_s = 5.0 }}
    """
    config.write_text(textwrap.dedent(text))
    scenario = config.with_name("straight.toml")
    bends = "road.segments = [{ length_m = 400.0 }]\nroad.lane_width_m = 4.0\nroad.left_m = 2.0\nroad.right_m = 2.0\n"
    ego = "ego.target_speed_mps = 15.0\nego.end_m = 250.0\nend.timeout_s = 40.0\n"
    scenario.write_text(f'name = "straight"\n{bends}{ego}expect.verdict = "avoided"\n')
    study = swerve.study({"name": "gaps", "base": {"scenario": str(scenario), "config": str(config)}, "axis": [axis]})
    assert [cell["verdict"] for cell in study.cells] == ["collision", "stopped"], study.cells


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("return self.scene()\n\n        def step", "return 3\n\n        def step", r"`Straight\.reset` returned a `int`; expected a `Scene`"),
        ("EgoState(self.now,", "EgoState(0,", r"the state of the world has the stamp 0: expected 5000000"),
        ("Obstacle(1,", "Obstacle(0,", "identity 0 is the ego's: expected 1 or more"),
        ("speed * yaw, yaw,", "float('nan'), yaw,", "ego: expected finite numbers"),
        ("return ObstacleList(self.now, self.others)", "return self.ego", "`Straight.observe` of sensor `obstacles` returned a `EgoState`"),
        ("brake_at_s=3.0, gap_m=30.0", "gap_m=30.0", "unknown key `brake_at_s`, expected one of gap_m, least_mps"),
        ("gap_m=30.0", "gap_m='far'", "keys.gap_m: expected a value of type str, found 12.0"),
    ],
)
def test_wrong_worlds_are_reported(file: Any, old: str, new: str, expected: str) -> None:
    config = of_world(f"{file(WORLD.replace(old, new))}:Straight", gap_m=12.0, brake_at_s=2.0)
    with pytest.raises(ValueError, match=expected):
        swerve.run(ROAD, config)


def test_world_and_operator_do_not_fit(file: Any) -> None:
    operator = """
        class Plain(swerve.Operator):
            pass
    """
    with pytest.raises(ValueError, match="do not fit: expected a `swerve.World`"):
        swerve.run(ROAD, of_world(f"{file(operator)}:Plain"))
    config = of_world(f"{file(WORLD)}:Straight")
    config["operator"]["imu_seen"] = {"kind": "python_sensor", "message": "Imu", "period_ms": 10.0}
    config["process"]["world"]["operators"].append("imu_seen")
    config["log"] = {"sensors": ["imu_seen"]}
    with pytest.raises(ValueError, match="operator `imu_seen` is a sensor of Imu; `Straight.sensors` declares obstacles: ObstacleList"):
        swerve.run(ROAD, config)


#: Follows the route at the target speed, by what it is given at the start.
FOLLOWER = """
    from swerve.messages import EgoState, Plan, PlanPoint, PlanStatus, Pose2, PredictionList

    class Follower(swerve.Operator):
        inputs = {"predictions": PredictionList, "poses": EgoState}
        outputs = {"plan": Plan}

        def begin(self, start):
            assert start.seed == 7 and start.limits.accel_max_mps2 > 0 and "lane" in start.scenario
            assert start.end_m > 100.0 and start.timeout_s > 10.0 and start.step_ns == 5_000_000
            self.route, self.speed_mps = start.route, start.target_speed_mps * start.read_keys(share=1.0).share

        def step(self, frame):
            known = [m for _, m in frame.windows["poses"] if m.stamp <= frame.stamp]
            if not known or frame["predictions"] is None:
                return None
            frame.spend(25)
            pose, route = known[-1].pose, self.route
            s = route.s_m[np.argmin(np.hypot(route.x_m - pose.x_m, route.y_m - pose.y_m))]
            t = np.arange(0.0, 4.0, 0.1)
            x, y, heading, curvature = route.at(s + 0.5 + self.speed_mps * t)
            points = [
                PlanPoint(frame.stamp + round(ti * 1e9), Pose2(xi, yi, hi), ci, self.speed_mps, 0.0)
                for ti, xi, yi, hi, ci in zip(*(a.tolist() for a in (t, x, y, heading, curvature)))
            ]
            return Plan(frame.stamp, PlanStatus.FOUND, points, 25)
"""


def with_follower(where: str, **keys: Any) -> dict[str, Any]:
    ports = {"inputs": {"predictions": "PredictionList", "poses": "window(16) EgoState"}, "outputs": {"plan": "Plan"}}
    work = {"work": {"base_ms": 5.0, "per_unit_us": 1000.0}}
    return {
        "operator": {"planner": {"kind": "python", **ports, "runtime": work}},
        "process": {"plan": {"operators": ["planner"], "python": where, "keys": keys}},
    }


def test_operator_follows_the_route_that_it_gets_at_the_start(file: Any) -> None:
    where = f"{file(FOLLOWER)}:Follower"
    result = swerve.run("lane", with_follower(where), seed=7)
    assert result.verdict == "completed", result.metrics
    assert abs(float(result.streams["pose"]["speed_mps"][-1]) - 8.0) < 0.5
    # The run time follows from the units of work: 5 ms and 25 units of 1 ms.
    plans = result.streams["planner"]
    assert set((plans.visible_at - plans.stamps).tolist()) == {30_000_000}
    slow = swerve.run("lane", with_follower(where, share=0.5), seed=7)
    assert abs(float(slow.streams["pose"]["speed_mps"][-1]) - 4.0) < 0.5


def test_study_varies_a_key_of_the_follower(file: Any, tmp_path: Path) -> None:
    """At 0.6 of the target speed the time is over before the goal; a cell has the digest of a run."""
    from swerve.studies import _toml

    config = with_follower(f"{file(FOLLOWER)}:Follower", share=0.6)
    (tmp_path / "follower.toml").write_text("".join(f"{key} = {_toml(value)}\n" for key, value in config.items()))
    base = {"scenario": "lane", "config": str(tmp_path / "follower.toml")}
    axis = {"key": "process.plan.keys.share", "values": [0.6, 1.0]}
    study = swerve.study({"name": "shares", "base": base, "axis": [axis]}, set={"seed": 7})
    assert [cell["verdict"] for cell in study.cells] == ["timeout", "completed"], study.cells
    alone = swerve.run("lane", config, seed=7)
    assert [f"{cell['digest']:016x}" == alone.digest for cell in study.cells] == [True, False]


def test_planner_gets_the_start_too(file: Any) -> None:
    where = file(
        """
        class Slow(swerve.Planner):
            def begin(self, start):
                self.share = start.read_keys(share=1.0).share
                assert abs(start.target_speed_mps - 8.0) < 0.3 and len(start.map) > 0

            def plan(self, request):
                t = np.arange(40) * 0.1
                speed = self.share * request.target_speed_mps
                along = request.route.at(request.along_m + t * speed)
                return request.answer(request.points(t, *along, np.full_like(t, speed)))
        """
    )
    process = {"operators": ["planner"], "python": f"{where}:Slow", "keys": {"share": 0.5}}
    config = {"planning": {"comfort": {"enabled": False}}, "process": {"plan": process}}
    result = swerve.run("lane", config)
    assert abs(float(result.streams["pose"]["speed_mps"][-1]) - 4.0) < 0.5
    with pytest.raises(ValueError, match="unknown key `shere`, expected one of share; did you mean `share`"):
        swerve.run("lane", config, set={"process.plan.keys.shere": 0.5})


def test_keys_need_a_class() -> None:
    with pytest.raises(ValueError, match="process.p.keys: are read by the class that `python` names"):
        swerve.run("lane", {"process": {"p": {"operators": ["planner"], "keys": {"a": 1}}}})
