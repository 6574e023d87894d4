"""Runs, studies and logs: what comes out is what the command line says."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import swerve

SHORT = "person_crossing"


@pytest.fixture(scope="module")
def run() -> swerve.Result:
    return swerve.run(SHORT, seed=3)


def test_the_module_is_the_program(run: swerve.Result, tmp_path: Path) -> None:
    words = [sys.executable, "-m", "swerve", "run", SHORT, "--json", "--seed", "3", "--out", str(tmp_path)]
    told = json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)
    assert (told["digest"], told["verdict"]) == (run.digest, run.verdict)
    # Why it ended so is read from a log, which a run in Python has none of.
    assert {**told, "why": None} == run.metrics
    log = swerve.read_log(tmp_path / "log.mcap")
    assert (log.digest, log.damage, log.seed) == (run.digest, None, 3)
    assert log.config == run.config
    for name, stream in run.streams.items():
        assert (log.streams[name].stamps == stream.stamps).all(), name
        assert log.streams[name].plain(-1) == stream.plain(-1), name
    steps = log.steps["operator"] == "planner"
    assert (log.steps["end"][steps] >= log.steps["start"][steps]).all() and steps.any()


def test_a_wrong_word_ends_with_the_programs_code() -> None:
    said = subprocess.run([sys.executable, "-m", "swerve", "run"], capture_output=True, text=True)
    assert said.returncode == 2 and "Usage" in said.stderr
    said = subprocess.run([sys.executable, "-m", "swerve", "run", "nowhere.toml"], capture_output=True, text=True)
    assert said.returncode == 1 and said.stderr.startswith("error: nowhere.toml")


def test_streams_are_columns_and_messages(run: swerve.Result) -> None:
    pose = run.streams["pose"]
    assert pose.message_type is swerve.messages.EgoState and pose.operator == "pose"
    speeds = [message.speed_mps for message in pose]
    assert (pose["speed_mps"] == speeds).all() and len(speeds) == len(pose) == len(pose.stamps)
    assert (pose["stamp"] == pose.stamps).all() and pose["stamp"].dtype == np.int64
    assert pose[-1].pose.x_m == pose["pose.x_m"][-1]
    assert (pose.visible_at >= pose.stamps).all()
    with pytest.raises(KeyError, match="speed_mps"):
        pose["speed"]
    with pytest.raises(IndexError):
        pose[len(pose)]
    world = run.streams["world"]
    assert world["ended"][-1] is not None and world["ended"][0] is None
    assert run.story.startswith("<svg") and "<svg" in run._repr_svg_()


def test_streams_are_tables(run: swerve.Result) -> None:
    pytest.importorskip("pandas")
    table = run.streams["pose"].to_pandas()
    assert table.index.name == "stamp_s"
    assert table["speed_mps"].iloc[-1] == run.streams["pose"][-1].speed_mps


def test_runs_in_threads_come_out_alike(run: swerve.Result) -> None:
    with ThreadPoolExecutor(3) as pool:
        digests = list(pool.map(lambda seed: swerve.run(SHORT, seed=seed).digest, [3, 4, 3]))
    assert digests[0] == digests[2] == run.digest != digests[1]


def test_dictionaries_are_files(run: swerve.Result) -> None:
    import tomllib

    scenario = tomllib.loads(swerve.scenarios()[SHORT])
    assert swerve.run(scenario, {"seed": 3}).digest == run.digest
    slow = swerve.run(SHORT, {"planning": {"planner": "aeb"}}, set={"ego.speed_mps": 5}, seed=3)
    assert 'planner = "aeb"' in slow.config and slow.digest != run.digest
    assert list(swerve.run(SHORT, streams=["imu"]).streams) == ["imu"]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"set": {"planning.planner": "rrtstar"}}, 'did you mean `rrt_star`'),
        ({"config": {"planing": {}}}, "planning"),
        ({"config": "no_such.toml"}, "no_such.toml"),
        ({"seed": -1}, "seed"),
    ],
)
def test_what_is_wrong_is_told_as_the_program_tells_it(arguments: dict[str, Any], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        swerve.run(SHORT, **arguments)
    with pytest.raises(TypeError):
        swerve.run(SHORT, {"seed": object()})


def test_progress_is_told_and_may_end_the_run() -> None:
    told: list[tuple[float, float]] = []

    class Enough(Exception):
        pass

    def progress(now: float, until: float) -> None:
        told.append((now, until))
        raise Enough

    with pytest.raises(Enough):
        # Much work in little simulated time, so that there is somebody to be told.
        swerve.run("traffic_jam", progress=progress)
    assert len(told) == 1 and 0 <= told[0][0] <= told[0][1]


def test_ctrl_c_ends_a_run() -> None:
    script = "import signal, swerve\nsignal.signal(signal.SIGINT, signal.default_int_handler)\ntry:\n  [swerve.run('traffic_jam') for _ in range(1000)]\nexcept KeyboardInterrupt:\n  print('ended')"
    process = subprocess.Popen([sys.executable, "-u", "-c", "print('begun')\n" + script], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stdout.readline() == "begun\n"
    timer = threading.Timer(3, lambda: process.send_signal(2))
    timer.start()
    assert process.communicate(timeout=120)[0] == "ended\n"


def test_a_log_is_recorded_where_it_is_asked_for(tmp_path: Path) -> None:
    result = swerve.run(SHORT, log=tmp_path / "log.mcap")
    log = swerve.read_log(tmp_path / "log.mcap")
    assert log.digest == result.digest and log.extra["scenario"] == result.scenario
    (tmp_path / "cut.mcap").write_bytes((tmp_path / "log.mcap").read_bytes()[:-40_000])
    cut = swerve.read_log(tmp_path / "cut.mcap")
    assert cut.damage and cut.digest is None and len(cut.streams["world"]) > 0
    (tmp_path / "none.mcap").write_bytes(b"no log")
    with pytest.raises(ValueError, match="none.mcap"):
        swerve.read_log(tmp_path / "none.mcap")


STUDY = {
    "name": "speeds",
    "description": "two speeds, two planners",
    "base": {"scenario": SHORT},
    "axis": [
        {"key": "ego.speed_mps", "values": [6, 10]},
        {"key": "planning.planner", "values": ["fot", "aeb"]},
    ],
}


def test_a_study_is_a_dictionary_or_a_file(tmp_path: Path) -> None:
    told: list[tuple[int, int]] = []
    study = swerve.study(STUDY, set={"seed": 2}, threads=2, out=tmp_path, progress=lambda *done: told.append(done))
    assert study.name == "speeds" and len(study.axes) == 2 and len(study.cells) == 4
    one = swerve.run(SHORT, {"seed": 2}, set={"ego.speed_mps": 10, "planning.planner": "aeb"})
    assert study.cells[3]["labels"] == ["10", "aeb"]
    assert study.cells[3]["verdict"] == one.verdict
    assert f"{study.cells[3]['digest']:016x}" == one.digest
    assert study.csv.count("\n") == 5 and study.heatmap.startswith("<svg")
    assert all(count == 4 for _, count in told)
    again = swerve.study(STUDY, set={"seed": 2}, out=tmp_path)
    assert again == study, "kept"
    pytest.importorskip("pandas")
    assert list(study.to_pandas()["verdict"]) == [cell["verdict"] for cell in study.cells]


def test_what_is_wrong_with_a_study_is_told() -> None:
    with pytest.raises(ValueError, match="planning"):
        swerve.study({**STUDY, "axis": [{"key": "planing.planner", "values": ["fot"]}]})


def test_results_and_streams_are_pickled(run: swerve.Result) -> None:
    again = pickle.loads(pickle.dumps(run))
    assert again.digest == run.digest and again.metrics == run.metrics and list(again.streams) == list(run.streams)
    for name, stream in run.streams.items():
        other = again.streams[name]
        assert (other.stamps == stream.stamps).all() and (other.origins == stream.origins).all()
        assert other[-1] == stream[-1] and other.operator == stream.operator and repr(other) == repr(stream)
    data = run.streams["pose"]._data
    kind, (*texts, times, payloads) = data.__reduce__()
    with pytest.raises(ValueError, match="its parts do not fit together"):
        kind(*texts, [times[0][:-8], *times[1:]], payloads)


def test_entries_of_lists_are_long_tables(run: swerve.Result) -> None:
    tracks = run.streams["tracker"]
    assert "tracks" in tracks.lists
    entries = tracks.entries("tracks")
    each = [(index, track) for index, message in enumerate(tracks) for track in message.tracks]
    assert len(each) > 20 and entries["message"].tolist() == [index for index, _ in each]
    assert entries["id"].tolist() == [track.id for _, track in each]
    assert entries["pose.x_m"].tolist() == [track.pose.x_m for _, track in each]
    assert (entries["stamp"] == tracks.stamps[entries["message"]]).all()
    with pytest.raises(KeyError, match="tracker has no list `trucks`, only tracks"):
        tracks.entries("trucks")
    pytest.importorskip("pandas")
    table = tracks.to_pandas("tracks")
    assert len(table) == len(each) and table.index.name == "stamp_s" and list(table["id"]) == entries["id"].tolist()


def test_streams_are_sliced(run: swerve.Result) -> None:
    pose = run.streams["pose"]
    assert pose[2:5] == [pose[2], pose[3], pose[4]] and pose[-2:] == [pose[-2], pose[-1]]
    assert pose[np.int64(3)] == pose[3]
    with pytest.raises(TypeError, match="pose: expected the name of a column, an index or a slice, found 1.5"):
        pose[1.5]  # type: ignore[index]


def test_tables_of_a_log_are_tables_of_pandas(tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    swerve.run(SHORT, log=tmp_path / "log.mcap")
    log = swerve.read_log(tmp_path / "log.mcap")
    table = log.steps.to_pandas()
    assert list(table.columns) == list(log.steps) and len(table) == len(log.steps["stamp"]) > 100


@pytest.mark.parametrize(
    ("arguments", "error", "says"),
    [
        ({"streams": ["nope"]}, ValueError, "streams: unknown stream `nope`, expected some of world, "),
        ({"streams": ["poze"]}, ValueError, "did you mean `pose`"),
        ({"streams": "pose"}, TypeError, "streams: expected a list of names, found the text 'pose'"),
        ({"streams": [3]}, TypeError, "streams: expected names, found 3"),
        ({"threads": 0}, ValueError, "threads: expected a whole number from 1 on, found 0"),
        ({"scenario": 3}, TypeError, "scenario: expected a file, a name or a dictionary, found 3"),
        ({"config": 3}, TypeError, "config: expected a file, a name or a dictionary, found 3"),
    ],
)
def test_wrong_arguments_are_errors(arguments: dict[str, Any], error: type[Exception], says: str) -> None:
    with pytest.raises(error, match=says):
        swerve.run(**{"scenario": SHORT, **arguments})
    if "config" not in arguments:
        with pytest.raises(error, match=says):
            swerve.Stack(**{"scenario": SHORT, **arguments})


def test_wrong_arguments_of_studies_are_errors() -> None:
    with pytest.raises(ValueError, match="threads: expected a whole number"):
        swerve.study(STUDY, threads=0)
    with pytest.raises(TypeError, match="study: expected a file"):
        swerve.study(3)  # type: ignore[arg-type]
