"""Converters of recorded drives to CommonRoad: the file has the places of the recording, and the stack drives it."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples/python"
SAMPLE = Path(os.environ.get("SWERVE_DATA", ROOT.parent / "shared/data")) / "prediction/argoverse2_sample"
STEPS, TURN_RAD, ORIGIN = 60, 0.7, (1200.0, -300.0)

#: Place of a road user by its step: along and beside a road.
Way = Callable[[int], tuple[float, float]]

#: Road users on a road along x: type, first and last step, way. The cyclist is out of sight for a while.
USERS: dict[str, tuple[str, list[int], Way]] = {
    "ego": ("vehicle", list(range(STEPS)), lambda k: (10.0 + 0.8 * k, 0.0)),
    "ahead": ("vehicle", list(range(STEPS)), lambda k: (40.0 + 0.9 * k, 0.0)),
    "late": ("vehicle", list(range(20, STEPS)), lambda k: (20.0 + 0.8 * k, 3.5)),
    "cyclist": ("cyclist", [*range(5, 20), *range(30, 45)], lambda k: (60.0 + 0.4 * k, -4.0)),
    "walker": ("pedestrian", list(range(STEPS)), lambda k: (50.0, 12.0 + 0.1 * k)),
}


def placed(x: float, y: float) -> tuple[float, float]:
    """A place on the road in the frame of the recording."""
    c, s = math.cos(TURN_RAD), math.sin(TURN_RAD)
    return ORIGIN[0] + c * x - s * y, ORIGIN[1] + s * x + c * y


def state(way: Way, k: int) -> tuple[float, float, float, float, float]:
    """Position, heading and velocity in the frame of the recording."""
    (x, y), (x1, y1) = placed(*way(k)), placed(*way(k + 1))
    return x, y, math.atan2(y1 - y, x1 - x), (x1 - x) / 0.1, (y1 - y) / 0.1


def line(*places: tuple[float, float]) -> list[dict[str, float]]:
    return [dict(zip("xyz", (*placed(*at), 0.0))) for at in places]


def segment(number: int, y: float, from_m: float, to_m: float, **more: Any) -> dict[str, Any]:
    """A lane segment of Argoverse 2, with one more point to the left than to the right."""
    middle = 0.5 * (from_m + to_m)
    left = line((from_m, y + 1.75), (middle, y + 1.75), (to_m, y + 1.75))
    right = line((from_m, y - 1.75), (to_m, y - 1.75))
    found = {"id": number, "lane_type": "VEHICLE", "is_intersection": False, "successors": [], "predecessors": []}
    found |= {"left_lane_boundary": left, "right_lane_boundary": right, "left_neighbor_id": None, "right_neighbor_id": None}
    return {**found, "left_lane_mark_type": "DASHED_WHITE", "right_lane_mark_type": "SOLID_WHITE", **more}


def argoverse(folder: Path) -> list[Path]:
    """A recording with two lanes, of which one goes on, and a crossing."""
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    rows = []
    for name, (kind, steps, way) in {**USERS, "noise": ("background", [0], USERS["walker"][2])}.items():
        for k in steps:
            x, y, heading, vx, vy = state(way, k)
            row = {"scenario_id": "made", "track_id": "AV" if name == "ego" else name, "object_type": kind, "timestep": k}
            rows.append({**row, "position_x": x, "position_y": y, "heading": heading, "velocity_x": vx, "velocity_y": vy})
    lanes = [
        segment(7001, 0.0, 0.0, 50.0, successors=[7003, 9999], left_neighbor_id=7002),
        segment(7002, 3.5, 0.0, 50.0, right_neighbor_id=7001),
        segment(7003, 0.0, 50.0, 250.0, is_intersection=True),
    ]
    crossing = {"id": 1, "edge1": line((100.0, -8.0), (100.0, 8.0)), "edge2": line((103.0, 8.0), (103.0, -8.0))}
    content = {"lane_segments": {str(lane["id"]): lane for lane in lanes}, "pedestrian_crossings": {"1": crossing}}
    parquet.write_table(arrow.Table.from_pylist(rows), folder / "scenario.parquet")
    (folder / "map.json").write_text(json.dumps(content))
    return [folder / "scenario.parquet", folder / "map.json"]


def scene(degrees: bool = False) -> dict[str, Any]:
    """The same recording as GPUDrive has it."""
    objects = []
    for number, (kind, steps, way) in enumerate(USERS.values(), 300):
        lists: dict[str, list[Any]] = {"position": [], "heading": [], "velocity": [], "valid": []}
        for k in range(STEPS):
            valid = k in steps
            x, y, heading, vx, vy = state(way, k) if valid else (-1e4,) * 5
            lists["position"].append({"x": x, "y": y, "z": 0.0})
            lists["velocity"].append({"x": vx, "y": vy})
            lists["heading"].append(math.degrees(heading) if degrees and valid else heading)
            lists["valid"].append(valid)
        size = {"vehicle": (4.6, 1.9), "cyclist": (1.8, 0.7), "pedestrian": (0.8, 0.8)}[kind]
        objects.append({"id": number, "type": kind, "length": size[0], "width": size[1], "height": 1.6, **lists})
    roads = [
        {"id": 1, "type": "lane", "map_element_id": 2, "geometry": line((0.0, 0.0), (25.0, 0.0), (25.0, 0.0), (50.0, 0.0))},
        {"id": 2, "type": "lane", "map_element_id": 2, "geometry": line((0.0, 3.5), (50.0, 3.5))},
        {"id": 3, "type": "lane", "map_element_id": 2, "geometry": line((50.2, 0.0), (250.0, 0.0))},
        {"id": 4, "type": "crosswalk", "geometry": line((100.0, -8.0), (100.0, 8.0), (103.0, 8.0), (103.0, -8.0))},
        {"id": 5, "type": "road_edge", "map_element_id": 15, "geometry": line((0.0, 6.0), (50.0, 6.0))},
    ]
    return {"scenario_id": "made", "objects": objects, "roads": roads, "tl_states": {}, "metadata": {"sdc_track_index": 0}}


def gpudrive(folder: Path) -> list[Path]:
    (folder / "scene.json").write_text(json.dumps(scene()))
    return [folder / "scene.json"]


def converted(script: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(EXAMPLES / f"{script}_to_commonroad.py"), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def swerve(*arguments: object, folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "swerve", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, cwd=folder, check=False)


def number(at: ElementTree.Element, path: str) -> float:
    return float(at.findtext(path, "nan"))


def states(root: ElementTree.Element) -> dict[int, list[tuple[float, float, float]]]:
    """Positions and headings of all obstacles by step."""
    found: dict[int, list[tuple[float, float, float]]] = {}
    for obstacle in root.iter("dynamicObstacle"):
        for at in [*obstacle.findall("initialState"), *obstacle.findall("trajectory/state")]:
            place = number(at, "position/point/x"), number(at, "position/point/y"), number(at, "orientation/exact")
            found.setdefault(int(number(at, "time/exact")), []).append(place)
    return found


@pytest.mark.parametrize(("script", "made"), [("argoverse", argoverse), ("gpudrive", gpudrive)])
def test_converted_drive_has_the_recorded_places_and_is_driven_to_the_goal(
    script: str, made: Callable[[Path], list[Path]], tmp_path: Path
) -> None:
    out = tmp_path / "out.xml"
    said = converted(script, *made(tmp_path), out)
    assert said.stdout.endswith(": 4 lanelets, 5 obstacles\n"), said
    root = ElementTree.parse(out).getroot()
    expected: dict[int, list[tuple[float, float, float]]] = {}
    for name, (_, steps, way) in USERS.items():
        for k in steps if name != "ego" else []:
            expected.setdefault(k, []).append(state(way, k)[:3])
    found = states(root)
    assert found.keys() == expected.keys()
    for k, places in expected.items():
        for one, other in zip(sorted(places), sorted(found[k]), strict=True):
            assert math.dist(one[:2], other[:2]) < 0.01 and abs(one[2] - other[2]) < 1e-6, k
    initial = root.find("planningProblem/initialState")
    assert initial is not None
    start = number(initial, "position/point/x"), number(initial, "position/point/y")
    assert math.dist(placed(10.0, 0.0), start) < 0.01
    assert number(initial, "velocity/exact") == pytest.approx(8.0)
    assert number(initial, "orientation/exact") == pytest.approx(TURN_RAD)
    lanes = list(root.iter("lanelet"))
    assert [one.get("ref") for one in lanes[0].findall("successor")] == ["3"]
    assert [one.get("ref") for one in lanes[0].findall("adjacentLeft")] == ["2"]
    assert [one.get("ref") for one in lanes[1].findall("adjacentRight")] == ["1"]
    assert lanes[3].findtext("laneletType") == "crosswalk"
    left, right = (lanes[0].findall(f"{side}Bound/point") for side in ("left", "right"))
    for point, y in [*((at, 1.75) for at in left), *((at, -1.75) for at in right)]:
        dx, dy = number(point, "x") - ORIGIN[0], number(point, "y") - ORIGIN[1]
        assert dy * math.cos(TURN_RAD) - dx * math.sin(TURN_RAD) == pytest.approx(y, abs=0.01)
    checked = swerve("check", out, folder=tmp_path)
    assert checked.returncode == 0 and "no problem" in checked.stdout, checked
    driven = swerve("run", out, "--solution", tmp_path / "solution.xml", folder=tmp_path)
    assert "solution.xml: valid" in driven.stdout + driven.stderr, driven


def test_older_scenes_have_degrees_and_places_in_the_list_for_ids(tmp_path: Path) -> None:
    old = scene(degrees=True)
    for each in old["objects"]:
        del each["id"]
    del old["metadata"]
    (tmp_path / "old.json").write_text(json.dumps(old))
    arguments = ["gpudrive", tmp_path / "old.json", tmp_path / "out.xml"]
    assert "expected radians" in converted(*arguments).stderr
    assert "see `--ego`" in converted(*arguments, "--degrees").stderr
    assert converted(*arguments, "--degrees", "--ego", "0").returncode == 0
    initial = ElementTree.parse(tmp_path / "out.xml").getroot().find("planningProblem/initialState")
    assert initial is not None and number(initial, "orientation/exact") == pytest.approx(TURN_RAD)


def without(key: str) -> Callable[[dict[str, Any]], Any]:
    return lambda content: content["objects"][1].pop(key)


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (lambda content: content.pop("roads"), "expected the lists `objects` and `roads`"),
        (without("valid"), "objects[1]: expected the key `valid`"),
        (lambda content: content["objects"][0]["heading"].pop(), "objects[0]: expected `position`, `heading`"),
        (lambda content: content["objects"][2]["position"].__setitem__(20, {"x": 1}), "position.20[0]: expected `x` and `y`"),
        (lambda content: content["objects"][0]["velocity"][3].update(x=math.nan), "x: expected a number, found nan"),
        (lambda content: content["objects"][0]["velocity"][3].update(x=10**400), "x: expected a number, found 1000"),
        (lambda content: content["objects"][0].update(type=["tram"]), "type: expected one of vehicle"),
        (lambda content: content.update(metadata=None), "metadata.sdc_track_index"),
        (lambda content: content["roads"].clear(), "expected lanes, found none"),
        (lambda content: content["objects"][0].update(valid=[False] * STEPS), "expected at least ten states, found 0"),
    ],
)
def test_wrong_scene_is_one_line_of_error(damage: Callable[[dict[str, Any]], Any], says: str, tmp_path: Path) -> None:
    content = scene()
    damage(content)
    (tmp_path / "scene.json").write_text(json.dumps(content))
    said = converted("gpudrive", tmp_path / "scene.json", tmp_path / "out.xml")
    assert said.returncode == 1 and says in said.stderr and said.stderr.count("\n") == 1, said
    assert not (tmp_path / "out.xml").exists()


def test_wrong_recording_of_argoverse_is_one_line_of_error(tmp_path: Path) -> None:
    scenario, lanes = argoverse(tmp_path)
    content = json.loads(lanes.read_text())
    content["lane_segments"]["7002"].pop("lane_type")
    (tmp_path / "damaged.json").write_text(json.dumps(content))
    (tmp_path / "cut.json").write_text(lanes.read_text()[:100])
    for files, says in (
        ([lanes, lanes], "map.json"),
        ([scenario, tmp_path / "damaged.json"], "lane_segments.7002: expected the key 'lane_type'"),
        ([scenario, tmp_path / "cut.json"], "expected JSON"),
        ([scenario, tmp_path / "missing.json"], "No such file"),
        ([scenario, lanes, "--ego", "AVX"], "found 'AVX'; known with ten states: AV, ahead"),
    ):
        said = converted("argoverse", *files[:2], tmp_path / "out.xml", *files[2:])
        assert said.returncode == 1 and says in said.stderr and said.stderr.count("\n") == 1, said


@pytest.mark.skipif(not SAMPLE.is_dir(), reason="the recording of Argoverse 2 is not here")
def test_recorded_scenario_of_argoverse_has_no_problem_and_is_driven(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    [scenario], [lanes] = SAMPLE.glob("*.parquet"), SAMPLE.glob("*.json")
    said = converted("argoverse", scenario, lanes, tmp_path / "out.xml")
    assert said.stdout.endswith(": 77 lanelets, 55 obstacles\n"), said
    table = parquet.read_table(scenario).to_pylist()
    expected: dict[int, list[tuple[float, float, float]]] = {}
    for row in table:
        if row["track_id"] != "AV" and row["object_type"] != "background":
            place = row["position_x"], row["position_y"], row["heading"]
            expected.setdefault(row["timestep"], []).append(place)
    found = states(ElementTree.parse(tmp_path / "out.xml").getroot())
    assert {k: sorted(at) for k, at in found.items()} == {k: sorted(at) for k, at in expected.items()}
    assert swerve("check", tmp_path / "out.xml", folder=tmp_path).returncode == 0
    driven = swerve("run", tmp_path / "out.xml", folder=tmp_path)
    assert "no collision        yes" in driven.stdout + driven.stderr, driven
