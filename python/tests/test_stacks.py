"""The stack in a foreign world."""

from __future__ import annotations

import math
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import swerve
from swerve.messages import ActorKind, EgoState, Extent, Imu, Obstacle, ObstacleList, Pose2, Signal, Vector2

STEP_NS = 50_000_000
ROUTE = [(0.0, 0.0), (100.0, 0.0)]


def ego(k: int, x_m: float = 2.0, y_m: float = 0.0, speed_mps: float = 8.0) -> EgoState:
    return EgoState(k * STEP_NS, Pose2(x_m, y_m, 0.0), speed_mps, 0.0, 0.0, 0.0, 0.0)


def box(number: int, x_m: float) -> Obstacle:
    return Obstacle(number, ActorKind.STATIC, Pose2(x_m, 0.0, 0.0), Extent(1.0, 1.0, 1.0), Vector2(0.0, 0.0), 1.0)


def drive(**options: Any) -> swerve.Result:
    """Drives along the route until it is over."""
    with swerve.Stack(route=ROUTE, speed_mps=8.0, **options) as stack:
        x_m, speed_mps = 2.0, 8.0
        for k in range(600):
            if stack.feed_scene(ego(k, x_m, 0.0, speed_mps), [box(1, 70.0)]):
                break
            command = stack.advance_to(k * 0.05)
            speed_mps = max(0.0, speed_mps + 0.05 * (3.0 * command.throttle - 8.0 * command.brake))
            x_m += 0.05 * speed_mps
    return stack.result


def program(*words: object, folder: Path) -> str:
    command = [sys.executable, "-m", "swerve", *map(str, words)]
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run
    return run.stdout


def test_equal_inputs_give_equal_digests_and_the_run_times_count(tmp_path: Path) -> None:
    first, again = drive(), drive(threads=2)
    assert first.digest == again.digest and first.metrics == again.metrics
    assert first.streams["pose"]["pose.x_m"][-1] < 70.0
    slow = drive(set={"operator.planner.runtime": {"fixed_ms": 300.0}})
    assert slow.digest != first.digest
    assert slow.metrics["response"] != first.metrics["response"]


def test_log_is_verified_explained_and_reported(tmp_path: Path) -> None:
    result = drive(out=tmp_path / "drive", seed=5)
    assert {path.name for path in (tmp_path / "drive").iterdir()} == {"log.mcap", "metrics.json", "report.html"}
    said = program("replay", "drive", "--verify", folder=tmp_path)
    assert f"digest {result.digest}, as logged" in said
    assert program("why", "drive", folder=tmp_path)
    assert program("report", "drive", "--out", "again.html", folder=tmp_path)
    log = swerve.read_log(tmp_path / "drive/log.mcap")
    assert len(log.streams["pose"]) == len(result.streams["pose"])
    refused = subprocess.run(
        [sys.executable, "-m", "swerve", "run", "lane", "--set", "sim.guest=true"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )
    assert refused.returncode != 0 and "sim.guest: there is no world" in refused.stderr


def test_log_of_a_program_that_fails_can_be_read(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), swerve.Stack(route=ROUTE, log=tmp_path / "part.mcap") as stack:
        for k in range(40):
            stack.feed("pose", ego(k))
            stack.advance_to(k * 0.05)
        _ = 1 / 0
    with pytest.raises(ValueError, match="the stack has finished"):
        stack.feed("pose", ego(41))
    said = program("replay", "part.mcap", folder=tmp_path)
    assert "planner" in said or "controller" in said, said


def test_inputs_have_classes_and_messages_come_back() -> None:
    stack = swerve.Stack(route=ROUTE)
    assert stack.inputs["pose"].message_type is EgoState
    assert "tracker" in stack.inputs["obstacles"].readers
    assert stack.newest("planner") is None
    stack.feed("pose", ego(0))
    stack.feed("obstacles", ObstacleList(0, [box(3, 50.0)]))
    assert stack.advance_to(0.0).brake >= 0.0
    stack.advance_to(0.2)
    assert stack.newest("pose") == ego(0)
    assert [track.id for track in stack.newest("tracker").tracks] == [3]
    assert all(0 <= each.at <= 2 * 10**8 for each in stack.commands) and stack.commands
    assert stack.now_s == 0.2 and stack.until_s == 3600.0
    assert math.dist(stack.route[0], ROUTE[0]) < 0.1
    assert stack.finish().verdict == "unfinished"
    assert stack.finish() is stack.result


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda s: s.feed("obstacle", ObstacleList(0, [])), "unknown input stream `obstacle`.*did you mean `obstacles`"),
        (lambda s: s.feed("pose", Imu(0, (0.0, 0.0, 9.8), (0.0, 0.0, 0.0))), "`pose`: expected .* EgoState, found Imu"),
        (lambda s: s.feed("pose", ego(0, math.nan)), "`pose`: pose.x_m is NaN"),
        (lambda s: s.feed("pose", ego(0, 2.0, 80.0)), "starts at .* off the road"),
        (lambda s: s.feed_scene(ego(0), [box(1, math.inf)]), r"obstacles\[0\]"),
        (lambda s: s.feed_scene(ego(0), [box(1, 5.0), box(1, 6.0)]), "identity 1 after 1"),
        (lambda s: s.feed_scene(ego(0), [box(0, 5.0)]), "identity 0 is the ego's"),
        (lambda s: (s.advance_to(1.0), s.advance_to(0.5)), "time goes back"),
        (lambda s: (s.advance_to(1.0), s.feed("pose", ego(20))), "before advancing"),
        (lambda s: s.advance_to(math.nan), "NaN s: expected"),
        (lambda s: s.advance_to(4000.0), "the scenario ends at 3600"),
        (lambda s: s.newest("planer"), "unknown stream `planer`"),
        (lambda s: (s.finish(), s.feed("pose", ego(0))), "the stack has finished"),
        (lambda s: (s.finish(), s.advance_to(1.0)), "the stack has finished"),
        (lambda s: s.result, "has not finished"),
    ],
)
def test_bad_input_is_refused_with_one_line(act: Any, words: str) -> None:
    stack = swerve.Stack(route=ROUTE)
    with pytest.raises(ValueError) as refused:
        act(stack)
    assert re.search(words, str(refused.value)) and "\n" not in str(refused.value), refused.value


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({}, "expected `route`, `map` or `scenario`"),
        ({"route": ROUTE, "scenario": "lane"}, "expected `route`, `map` or `scenario`"),
        ({"route": [(0.0, 0.0)]}, "expected two or more"),
        ({"route": [0.0, 1.0]}, "expected rows of x and y"),
        ({"map": "nowhere.xodr", "start": (0.0, 0.0), "goal": (1.0, 0.0)}, "nowhere.xodr"),
        ({"map": "nowhere.xodr"}, "expected `start` and `goal`"),
        ({"scenario": "lane", "set": {"operator.world.delay_ms": 1.0}}, "operator.world: the world is the program"),
        ({"scenario": "lane", "set": {"clock.source": "wall"}}, "clock.source"),
        ({"scenario": "lane", "set": {"planning.planer": "fot"}}, "did you mean"),
        ({"scenario": "maps/two_egos"}, "several egos"),
    ],
)
def test_stacks_that_cannot_be_made_are_refused(options: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        swerve.Stack(**options)


def test_way_over_a_map_and_road_of_a_scenario() -> None:
    folder = Path(__file__).resolve().parents[2] / "scenarios/maps"
    on_map = swerve.Stack(map=folder / "two_lane_road.xodr", start=(20.0, -1.75), goal=(150.0, -1.75))
    assert abs(float(on_map.route[0][1]) + 1.75) < 0.1
    assert on_map.until_s == 3600.0
    street = swerve.Stack(scenario="street")
    assert street.until_s < 3600.0


def test_lights_of_a_map_are_those_that_the_world_feeds() -> None:
    file = Path(__file__).resolve().parents[2] / "scenarios/maps/crossing.xodr"
    # From the south to the north; the stop line is 2 m before the crossing.
    ends = {"start": {"x_m": 1.75, "y_m": -90.0}, "goal": {"x_m": 1.75, "y_m": 90.0}, "target_speed_mps": 8.0}
    scenario = {"name": "crossing", "map": {"file": str(file), "all_lights": True}, "ego": ends, "end": {"timeout_s": 60.0}}

    def driven(red_s: float) -> list[float]:
        """Places of the rear axle along the way, of a car whose light is red at first."""
        places, speed_mps = [-90.0], 8.0
        with swerve.Stack(scenario=scenario) as stack:
            assert sorted(stack.lights) == ["light_east", "light_north", "light_south", "light_west"]
            for k in range(560):
                at = EgoState(k * STEP_NS, Pose2(1.75, places[-1], math.pi / 2), speed_mps, 0.0, 0.0, 0.0, 0.0)
                own = Signal.RED if 0.05 * k < red_s else Signal.GREEN
                stack.feed_lights(at, {"light_south": own, "light_east": Signal.RED})
                stack.feed_scene(at, [])
                command = stack.advance_to(k * 0.05)
                speed_mps = max(0.0, speed_mps + 0.05 * (3.0 * command.throttle - 8.0 * command.brake))
                places.append(places[-1] + 0.05 * speed_mps)
            [light] = stack.newest("lights").lights
            assert light.name == "light_south" and light.stop_s_m is not None
            with pytest.raises(ValueError, match="unknown light `light_west_`: the scenario has 4 lights; did you mean `light_west`"):
                stack.feed_lights(at, {"light_west_": Signal.RED})
        return places

    waits, passes = driven(20.0), driven(0.0)
    assert max(waits[:400]) < -15.0 and waits[395] - waits[370] < 0.1, (max(waits[:400]), waits[395] - waits[370])
    assert waits[-1] > 0.0 and passes[400] > 0.0
    with swerve.Stack(route=ROUTE) as stack:
        assert stack.lights == []
        stack.feed_lights(ego(0), {})
