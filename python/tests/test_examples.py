"""The examples, as a user would run them: from an empty folder."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples/python"


def python(folder: Path, *arguments: object) -> str:
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, cwd=folder, check=True).stdout


@pytest.mark.parametrize("example", ["run", "study", "torch_detector", "train"])
def test_an_example_runs_anywhere(example: str, tmp_path: Path) -> None:
    few = [1, 4] if example == "train" else []
    assert python(tmp_path, EXAMPLES / f"{example}.py", *few)


def test_planner_avoids_the_person_as_the_program_has_it(tmp_path: Path) -> None:
    said = python(tmp_path, EXAMPLES / "planner.py").splitlines()
    assert len(said) == 2 and "avoided" in said[1], said
    config = EXAMPLES / "planner.toml"
    ran = python(tmp_path, "-m", "swerve", "run", "person_crossing", "-c", config, "--allow-code", "--json")
    digest = re.search(r'"digest": *"(\w+)"', ran)
    assert digest and said[1].endswith(digest[1]), said


def test_ego_drives_around_the_barrier_that_an_operator_finds_on_map_and_route(tmp_path: Path) -> None:
    config = EXAMPLES / "barriers.toml"
    ran = python(tmp_path, "-m", "swerve", "run", "maps/closed_road", "-c", config, "--allow-code")
    assert "as the scenario expects" in ran, ran


def test_the_page_on_maps_shows_the_operator_and_its_configuration() -> None:
    page = (EXAMPLES.parents[1] / "docs/howto/drive_on_a_map.md").read_text()
    code = (EXAMPLES / "barriers.py").read_text()
    config = (EXAMPLES / "barriers.toml").read_text()
    assert "```python barriers.py\n" + code[code.index("import swerve") :] + "```" in page
    assert "```toml config\n" + config[config.index("[operator") :] + "```" in page


def test_the_detector_drives_as_the_program_has_it(tmp_path: Path) -> None:
    said = python(tmp_path, EXAMPLES / "detector.py")
    config = EXAMPLES / "detector.toml"
    ran = python(tmp_path, "-m", "swerve", "run", "person_behind_truck", "-c", config, "--allow-code", "--json")
    digest = re.search(r'"digest": *"(\w+)"', ran)
    assert digest and f"digest {digest[1]}\n" in said, said


def test_the_guest_avoids_the_person_and_its_log_is_verified(tmp_path: Path) -> None:
    said = python(tmp_path, EXAMPLES / "guest.py")
    assert said.startswith("avoided at "), said
    replayed = python(tmp_path, "-m", "swerve", "replay", "guest", "--verify")
    assert said.split()[-1] in replayed, replayed
    assert len((EXAMPLES / "guest.py").read_text().splitlines()) <= 60


def test_the_guest_drives_in_highway_env(tmp_path: Path) -> None:
    pytest.importorskip("highway_env")
    said = python(tmp_path, EXAMPLES / "highway_guest.py")
    assert "crashed: False" in said, said


def test_the_stack_turns_left_at_the_crossing_of_highway_env(tmp_path: Path) -> None:
    # Without the map of the crossing, it crashes in this episode.
    pytest.importorskip("highway_env")
    episode = "import sys; sys.path.append(sys.argv[1]); import highway_table; print(highway_table.stack('intersection-v1', 0))"
    said = python(tmp_path, "-c", episode, EXAMPLES)
    assert "crashed=False, is_through=True" in said, said


def test_highway_env_is_a_world_with_the_digest_of_the_page(tmp_path: Path) -> None:
    pytest.importorskip("highway_env")
    scenario, config = EXAMPLES / "highway_world_scenario.toml", EXAMPLES / "highway_world.toml"
    ran = python(tmp_path, "-m", "swerve", "run", scenario, "-c", config, "--allow-code", "--json")
    digest = re.search(r'"digest": *"(\w+)"', ran)
    assert digest and f"`{digest[1]}`" in (EXAMPLES.parents[1] / "docs/howto/world_in_python.md").read_text(), ran
    assert len((EXAMPLES / "highway_world.py").read_text().splitlines()) <= 60


def test_the_study_of_detectors_and_the_network_are_valid_configurations(tmp_path: Path) -> None:
    for name in ("detector_study.toml", "onnx_detector.toml"):
        assert python(tmp_path, "-m", "swerve", "check", EXAMPLES / name)
