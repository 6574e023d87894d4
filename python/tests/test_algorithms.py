"""Algorithms in Python, called by operators of the stack."""

from __future__ import annotations

import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import swerve


@pytest.fixture
def file(tmp_path: Path) -> Any:
    def write(text: str) -> str:
        path = tmp_path / "algorithm_under_test.py"
        path.write_text("import numpy as np\nimport swerve\nfrom swerve import messages\n" + textwrap.dedent(text))
        return str(path)

    return write


def by(name: str, where: str, **more: Any) -> dict[str, Any]:
    return {**more, "process": {"python": {"operators": [name], "python": where}}}


ROUTE = """
    class Along(swerve.Planner):
        def plan(self, request):
            t = np.arange(40) * 0.1
            along = request.route.at(request.along_m + t * request.target_speed_mps)
            points = request.points(t, *along, np.full_like(t, request.target_speed_mps))
            assert all(abs(point.accel_mps2) < 1e-9 for point in points)
            return request.answer(points, messages.PlanStatus.ROUTE, work=3)
"""


def test_planner_plans_with_the_comfort_layer_and_counted_work(file: Any) -> None:
    where = f"{file(ROUTE)}:Along"
    alone = {"planning": {"comfort": {"enabled": False}}}
    result = swerve.run("lane", by("planner", where, **alone))
    plans = list(result.streams["planner"])
    assert len(plans) > 20 and {plan.status.value for plan in plans} == {"route"}
    assert {plan.work for plan in plans} == {3}
    # Above the planner, the comfort layer of the stack.
    layered = list(swerve.run("lane", by("planner", where)).streams["planner"])
    assert "comfortable" in {plan.status.value for plan in layered}
    # Each of three units takes 10 ms.
    work = {"operator": {"planner": {"runtime": {"work": {"base_ms": 0.0, "per_unit_us": 10_000.0}}}}}
    timed = swerve.run("lane", by("planner", where, **alone, **work)).streams["planner"]
    assert set((timed.visible_at - timed.stamps).tolist()) == {30_000_000}


def test_chain_of_a_collision_plans_again_with_consent(file: Any, tmp_path: Path) -> None:
    """Plans of a class in Python are computed again only if its file may be run: here they do not depend on the person."""
    log, alone = str(tmp_path / "drive.mcap"), {"planning": {"comfort": {"enabled": False}}}
    swerve.run("person_crossing", by("planner", f"{file(ROUTE)}:Along", **alone), log=log)
    command = [sys.executable, "-m", "swerve", "why", log]
    allowed = subprocess.run([*command, "--allow-code"], capture_output=True, text=True, check=True).stdout
    assert "no plan had changed because of it before the collision" in allowed, allowed
    why = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert "planner would have planned without it cannot be computed" in why and "changed" not in why, why


def test_planner_replaces_the_one_of_the_paper(file: Any) -> None:
    result = swerve.run("lane", by("planner", f"{file(ROUTE)}:Along", planning={"preset": "paper"}))
    assert {plan.work for plan in result.streams["planner"]} == {3}


def test_run_is_reproducible_and_replayed(file: Any, tmp_path: Path) -> None:
    config, log = by("planner", f"{file(ROUTE)}:Along"), str(tmp_path / "drive.mcap")
    assert swerve.run("lane", config, log=log).digest == swerve.run("lane", config, threads=2).digest


def test_predictor_predicts_at_the_instants_of_the_horizon(file: Any) -> None:
    where = file(
        """
        class Standing(swerve.Predictor):
            def predict(self, tracks, instants, route):
                assert route is not None and len(route.s_m) > 50
                predictions = [
                    messages.Prediction(t.id, t.kind, t.extent, 1.0, [messages.PredictedPose(at, t.pose) for at in instants])
                    for t in tracks.tracks
                ]
                return messages.PredictionList(tracks.stamp, predictions)
        """
    )
    result = swerve.run("person_crossing", by("predictor", f"{where}:Standing"))
    predictions = [one for message in result.streams["predictor"] for one in message.predictions]
    assert len(predictions) > 20 and all(one.path[0].pose == one.path[-1].pose for one in predictions)


def test_tracker_tracks_boxes(file: Any) -> None:
    where = file(
        """
        class Each(swerve.Tracker):
            def update(self, found, ego):
                cos, sin = np.cos(ego.heading_rad), np.sin(ego.heading_rad)
                tracks = []
                for k, box in enumerate(found.boxes):
                    x = float(ego.x_m + cos * box.pose.x_m - sin * box.pose.y_m)
                    y = float(ego.y_m + sin * box.pose.x_m + cos * box.pose.y_m)
                    seen = [messages.Sighting(found.stamp, messages.Point2(x, y))]
                    pose = messages.Pose2(x, y, ego.heading_rad + box.pose.heading_rad)
                    tracks.append(messages.Track(k + 1, box.kind, pose, box.extent, messages.Vector2(0.0, 0.0), seen))
                return messages.TrackList(found.stamp, tracks)
        """
    )
    detector = {"perception": {"detector": "efficientdet-d3@v100"}}
    tracks = swerve.run("person_crossing", by("tracker", f"{where}:Each", **detector)).streams["tracker"]
    assert sum(len(message.tracks) for message in tracks) > 10


def test_exceptions_and_wrong_operators_are_reported(file: Any, capfd: pytest.CaptureFixture[str]) -> None:
    where = file(
        """
        class Broken(swerve.Planner):
            def plan(self, request):
                raise RuntimeError("boom")
        """
    )
    with pytest.raises(ValueError, match=r"(?s)operator `planner` panicked: RuntimeError: boom.*line \d+, in plan"):
        swerve.run("lane", by("planner", f"{where}:Broken", planning={"comfort": {"enabled": False}}))
    with pytest.raises(ValueError):
        swerve.run("lane", by("tracker", f"{where}:Broken"))
    said = capfd.readouterr().err
    expected = "operator `tracker` publishes TrackList; Broken is a planner, expected an operator that publishes Plan"
    assert expected in said


@pytest.mark.parametrize(
    "code, expected",
    [
        ("pass", r"`Bad\.plan` returned nothing; expected a `Plan`"),
        ("return request.answer([])", r"`Bad\.plan` returned a `Plan` without points; expected at least one `PlanPoint`"),
        (
            "return with_speed(request, math.nan)",
            r"`Bad\.plan` returned a `Plan` with points\[0\]\.accel_mps2 = nan; expected a finite number",
        ),
    ],
)
def test_wrong_answer_names_class_method_and_expected_type(file: Any, code: str, expected: str) -> None:
    where = file(f"""
        import math

        def with_speed(request, speed_mps):
            pose = request.start.pose
            return request.answer(request.points([0, 1], pose.x_m, pose.y_m, pose.heading_rad, 0, [5, speed_mps]))

        class Bad(swerve.Planner):
            def plan(self, request):
                {code}
        """)
    with pytest.raises(ValueError, match=expected):
        swerve.run("lane", by("planner", f"{where}:Bad", planning={"comfort": {"enabled": False}}))


def test_class_that_cannot_be_loaded_is_in_the_exception(file: Any) -> None:
    where = file(ROUTE)
    with pytest.raises(ValueError, match=r"(?s)process `python` ended .* before it was ready.*no operator `Alon`, only Along"):
        swerve.run("lane", by("planner", f"{where}:Alon"))


def test_path_beside_a_circle_has_its_own_heading_and_curvature() -> None:
    """Along a left bend of 50 m: a path 2 m to its left has the radius 48 m; one that moves to the left at a tenth of its
    way along that circle is turned by the arctangent of 0.1."""
    angle = np.linspace(0.0, 1.0, 101)
    ones = np.ones_like(angle)
    x, y = 50.0 * np.sin(angle), 50.0 * (1.0 - np.cos(angle))
    route = swerve.algorithms.Route(50.0 * angle, x, y, angle, ones / 50.0, 5.0 * ones, 5.0 * ones)
    s = np.linspace(5.0, 20.0, 31)
    x, y, heading, curvature = route.path(s, 2.0)
    assert np.allclose(np.hypot(x, y - 50.0), 48.0, atol=1e-2)
    assert np.allclose(heading, s / 50.0, atol=1e-3) and np.allclose(curvature, 1.0 / 48.0, rtol=1e-2)
    heading = route.path(s, 0.1 * (s - s[0]))[2]
    assert np.allclose(heading[:3] - s[:3] / 50.0, np.arctan(0.1), atol=2e-3)
    # At rest: the values of the route.
    assert np.allclose(route.path([5.0, 5.0], 1.0)[3], 1.0 / 50.0)


def test_pipeline_has_the_name_of_the_class(file: Any) -> None:
    assert swerve.run("lane", by("planner", f"{file(ROUTE)}:Along")).metrics["pipeline"] == "Along"
