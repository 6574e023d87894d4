"""Operators in Python: in a process of a run, on the very memory that a sensor wrote."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import textwrap
import time
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

#: The file that an array lies in, and where in it.
PLACE = """
        def place(array):
            address = array.__array_interface__["data"][0]
            for line in open("/proc/self/maps"):
                words = line.split()
                first, last = (int(word, 16) for word in words[0].split("-"))
                if first <= address < last:
                    return (words[5] if len(words) > 5 else ""), int(words[2], 16) + address - first
"""


def with_worker(operator: str, where: str, **more: Any) -> dict[str, Any]:
    return {**SENSORS, **more, "process": {"python": {"operators": [operator], "python": where}}}


@pytest.fixture
def file(tmp_path: Path) -> Any:
    def write(text: str) -> str:
        path = tmp_path / "operator_under_test.py"
        path.write_text("import numpy as np\nimport swerve\nfrom swerve import messages\n" + textwrap.dedent(text))
        return str(path)

    return write


def test_images_are_read_where_they_lie(file: Any) -> None:
    """Two workers write down where in which file of the shared memory their array is: it is one place. A copy is none."""
    where = file(
        PLACE
        + """
        class Eye(swerve.Operator):
            inputs = {"image": messages.Image}
            outputs = {"health": messages.SensorHealth}

            def step(self, frame):
                image = frame["image"]
                assert not image.pixels.flags.owndata and not image.pixels.flags.writeable
                name, offset = place(image.pixels)
                assert name.startswith("/dev/shm/"), name
                assert not place(image.pixels.copy())[0].startswith("/dev/shm/")
                commonest = np.bincount(image.pixels.reshape(-1)).max() / image.pixels.size
                where = int.from_bytes(name[-7:].encode(), "little") ^ offset
                return messages.SensorHealth(image.stamp, image.pixels.size, 0, float(np.float32(commonest)), False, where)
        """
    )
    other = {"monitor": {"eye": {"sensor": "front"}, "other": {"sensor": "front"}}}
    config = with_worker("eye", f"{where}:Eye", **other)
    config["process"]["second"] = {"operators": ["other"], "python": f"{where}:Eye"}
    result = swerve.run("lane", config, set={"ego.speed_mps": 30})
    health = list(result.streams["eye"])
    assert len(health) > 5 and {message.numbers for message in health} == {320 * 160 * 3}
    assert [message.checksum for message in health] == [message.checksum for message in result.streams["other"]]
    here = swerve.run("lane", {**SENSORS, **other}, set={"ego.speed_mps": 30})
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
                print(len(tracks), "tracks")  # for people: to standard error
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


FINDER = """
    class Finder(swerve.Operator):
        # In another order than the ports of the configuration.
        outputs = {"boxes": messages.Detections}
        inputs = {"seen": messages.ObstacleList, "ego": messages.EgoState}

        def step(self, frame):
            seen, ego = frame["seen"], frame["ego"]
            if seen is None or ego is None:
                return None
            cos, sin = np.cos(ego.pose.heading_rad), np.sin(ego.pose.heading_rad)
            boxes = []
            for o in seen.obstacles:
                x, y = o.pose.x_m - ego.pose.x_m, o.pose.y_m - ego.pose.y_m
                pose = messages.Pose2(cos * x + sin * y, cos * y - sin * x, o.pose.heading_rad - ego.pose.heading_rad)
                boxes.append(messages.DetectedBox(o.kind, 0.9, pose, 0.0, o.extent, None))
            return messages.Detections(seen.stamp, boxes)
"""


def with_finder(where: str, **keys: Any) -> dict[str, Any]:
    finder = {
        "kind": "python",
        "inputs": {"ego": "latest EgoState", "seen": "ObstacleList"},
        "outputs": {"boxes": "Detections"},
        "runtime": {"fixed_ms": 20.0},
    }
    process = {"operators": ["finder"], "python": f"{where}:Finder"}
    return {"operator": {"finder": {**finder, **keys}}, "process": {"finder": process}}


def swerve_says(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "swerve", *words], capture_output=True, text=True, check=False)


def test_a_configuration_adds_an_operator(file: Any, tmp_path: Path) -> None:
    """The stack's tracker takes what a detector in Python finds: the same at each time, and in a replay."""
    config, log = with_finder(file(FINDER)), str(tmp_path / "drive.mcap")
    result = swerve.run("person_crossing", config, log=log)
    finder = result.streams["finder"]
    assert len(finder) > 20 and (finder.visible_at - finder.stamps == 20_000_000).all()
    assert sum(len(message.tracks) for message in result.streams["tracker"]) > 0
    assert swerve.run("person_crossing", config, threads=2).digest == result.digest
    late = {**config, "fault": {"late": {"stream": "finder", "delay_ms": 200.0}}}
    assert swerve.run("person_crossing", late).digest != result.digest
    assert swerve.run("person_crossing", with_finder(file(FINDER), runtime={"zero": True})).digest != result.digest
    replayed = swerve_says("replay", log, "--allow-code", "--verify", "--from", "finder")
    assert replayed.returncode == 0 and f"digest {result.digest}, as logged" in replayed.stdout, replayed
    file(FINDER.replace("0.9", "0.8"))
    replayed = swerve_says("replay", log, "--allow-code", "--verify", "--from", "finder")
    assert replayed.returncode == 1 and "the replay differs from the log" in replayed.stderr, replayed


def test_a_run_with_measured_time_is_replayed(file: Any, tmp_path: Path) -> None:
    log = str(tmp_path / "drive.mcap")
    result = swerve.run("person_crossing", with_finder(file(FINDER), runtime={"measured": 3.0}), log=log)
    finder = result.streams["finder"]
    assert len(set((finder.visible_at - finder.stamps).tolist())) > 5, "each step takes its time"
    replayed = swerve_says("replay", log, "--allow-code", "--verify", "--from", "finder")
    assert replayed.returncode == 0, replayed


def test_cells_of_a_study_and_environments_have_it_too(file: Any, tmp_path: Path) -> None:
    pytest.importorskip("gymnasium")
    import swerve.gym

    config = with_finder(file(FINDER))
    run = swerve.run("person_crossing", config, seed=3)
    (tmp_path / "base.toml").write_text(run.config)
    base = {"scenario": "person_crossing", "config": str(tmp_path / "base.toml")}
    content = {"base": base, "axis": [{"name": "seed", "key": "seed", "values": [3]}]}
    study = swerve.study(content, out=tmp_path / "out")
    assert [f"{cell['digest']:016x}" for cell in study.cells] == [run.digest]
    env = swerve.gym.DrivingEnv("person_crossing", config, observe="tracker", level="target")
    env.reset(seed=3)
    observations = [env.step(env.action_space.sample())[0] for _ in range(40)]
    assert any(observation.any() for observation in observations)


def test_ports_of_a_configuration_go_by_their_names(file: Any, capfd: pytest.CaptureFixture[str]) -> None:
    where = file(FINDER.replace('"seen": messages', '"obstacles": messages'))
    with pytest.raises(ValueError, match="process `finder`"):
        swerve.run("lane", with_finder(where))
    said = capfd.readouterr().err
    expected = "are (ego: EgoState, seen: ObstacleList), the class declares (obstacles: ObstacleList, ego: EgoState)"
    assert f"inputs of operator `finder` {expected}" in said


@pytest.mark.parametrize(
    ("process", "says"),
    [
        ({"python": "no_such.py:Finder"}, "process.finder.python: there is no file .*no_such.py"),
        ({"python": "finder.py"}, "process.finder.python: expected FILE.py:Class"),
        ({}, "process.finder.operators.0.: `finder` is written in Python"),
        ({"python": f"{__file__}:Finder", "start": ["ssh"]}, "process.finder.start: expected `start` or `python`"),
        ({"python": f"{__file__}:Finder", "interpreter": "/bin/false"}, "/bin/false has not the package `swerve`"),
    ],
)
def test_a_process_that_cannot_be_is_told(process: dict[str, Any], says: str) -> None:
    config = with_finder("")
    config["process"]["finder"] = {"operators": ["finder"], **process}
    with pytest.raises(ValueError, match=says):
        swerve.run("lane", config)


#: What needs the program itself.
with_program = pytest.mark.skipif("SWERVE_BINARY" not in os.environ, reason="SWERVE_BINARY names no program")


def program(*arguments: object, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [os.environ["SWERVE_BINARY"], *map(str, arguments)]
    environment = {**os.environ, "VIRTUAL_ENV": sys.prefix, **environment}
    return subprocess.run(command, capture_output=True, text=True, env=environment, cwd="/", check=False)


@with_program
def test_the_program_itself_runs_a_class_beside_its_configuration(file: Any, tmp_path: Path) -> None:
    config = tmp_path / "finder.toml"
    config.write_text(swerve.run("lane", with_finder(file(FINDER))).config.replace(f"{tmp_path}/", ""))
    said = program("run", "lane", "-c", config, "--allow-code", "--json", "--out", tmp_path / "out")
    assert f'"digest": "{swerve.run("lane", with_finder(file(FINDER))).digest}"' in said.stdout, said
    refused = program("run", "lane", "-c", config)
    assert refused.returncode == 1 and "expected --allow-code" in refused.stderr, refused
    with pytest.raises(ValueError, match="process.finder.python: .* expected --allow-code"):
        swerve.run("lane", config)
    swerve.run("lane", config, allow_code=True)


#: Foresees nobody: who drives by it stops for nobody.
NOBODY = """
class Nobody(swerve.Operator):
    inputs = {"tracks": messages.TrackList}
    outputs = {"predictions": messages.PredictionList}

    def step(self, frame):
        return messages.PredictionList(frame["tracks"].stamp, [])
"""

NOBODYS = """
[operator.predictor]
kind = "python"
inputs = { tracks = "TrackList" }
outputs = { predictions = "PredictionList" }

[process.python]
operators = ["predictor"]
python = "operator_under_test.py:Nobody"
"""


@with_program
def test_a_data_set_is_driven_with_an_operator_in_python(file: Any, tmp_path: Path) -> None:
    camera = 'outputs = ["rgb", "depth", "semantic", "instance"]'
    camera = f"[camera.front]\nwidth_px = 320\nheight_px = 160\nperiod_ms = 500\n{camera}\n"
    file(NOBODY)
    samples = []
    for name, text in (("without", camera), ("with", camera + NOBODYS)):
        config = tmp_path / f"{name}.toml"
        config.write_text(text)
        said = program("dataset", "person_crossing", "-c", config, "--allow-code", "--out", tmp_path / name)
        assert said.returncode == 0, said
        samples.append(len((tmp_path / name / "index.csv").read_text().splitlines()) - 1)
    # The drive that stops for nobody ends at the person.
    assert 5 < samples[1] < samples[0], samples


def emulated_car(domain: int) -> subprocess.Popen[str] | None:
    """A car with Autoware's interface, where there is Cyclone DDS for it."""
    python = os.environ.get("SWERVE_PYTHON", sys.executable)
    found = shutil.which(python) is not None
    if not found or subprocess.run([python, "-c", "import cyclonedds"], capture_output=True, check=False).returncode != 0:
        assert "SWERVE_CI" not in os.environ, "SWERVE_CI is set, and cyclonedds is not installed"
        return None
    general = '<Interfaces><NetworkInterface name="lo"/></Interfaces><AllowMulticast>false</AllowMulticast>'
    peers = '<ParticipantIndex>auto</ParticipantIndex><Peers><Peer Address="127.0.0.1"/></Peers>'
    domain_xml = f"<Domain><General>{general}</General><Discovery>{peers}</Discovery></Domain>"
    emulator = Path(__file__).parents[2] / "tests/ros2/vehicle_emulator.py"
    car = subprocess.Popen(
        [python, emulator, str(domain), "autoware"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "CYCLONEDDS_URI": f"<CycloneDDS>{domain_xml}</CycloneDDS>"},
    )
    assert car.stdout is not None and car.stdout.readline() == "ready\n"
    return car


@with_program
def test_a_car_is_driven_with_an_operator_in_python(file: Any, tmp_path: Path) -> None:
    """Python takes its time to come up; the drive begins when it has."""
    domain = 100 + os.getpid() % 100
    car = emulated_car(domain)
    if car is None:
        pytest.skip("Python's package cyclonedds is not installed")
    try:
        file(NOBODY)
        config = tmp_path / "live.toml"
        live = '[live]\nroute = "lane"\n[ros2]\nvehicle = "autoware"\n[control]\ncontroller = "stanley"\n'
        config.write_text(live + NOBODYS)
        drive = ("live", config, "--allow-code", "--enable", "at-start", "--seconds", 8, "--json", "--out", tmp_path / "out")
        said = program(*drive, ROS_DOMAIN_ID=str(domain), ROS_LOCALHOST_ONLY="1")
        assert said.returncode == 0, said
        driven = json.loads(said.stdout)
        assert driven["drive"]["driven_m"] > 5 and driven["drive"]["refused"]["ahead"] == 0, driven["drive"]
        predictor = [o for o in driven["operators"] if o["operator"] == "predictor"]
        assert predictor and predictor[0]["steps"] > 50, driven["operators"]
        assert "as logged" in program("replay", tmp_path / "out/log.mcap", "--allow-code", "--verify").stdout
    finally:
        car.kill()
        car.wait()


@pytest.mark.parametrize("change", ["image", "dark(image)"])
def test_images_are_published(file: Any, change: str) -> None:
    """An image as it was read, and one of its own."""
    where = file(
        f"""
        def dark(image):
            return messages.Image(image.stamp, image.width_px, image.height_px, image.camera, np.array(image.pixels) // 2)

        class Filter(swerve.Operator):
            inputs = {{"image": messages.Image}}
            outputs = {{"out": messages.Image}}

            def step(self, frame):
                image = frame["image"]
                return {change}
        """
    )
    camera = {"front": {"width_px": 160, "height_px": 80, "period_ms": 500}}
    declared = {"kind": "python", "inputs": {"image": "Image"}, "outputs": {"out": "Image"}}
    process = {"operators": ["filter"], "python": f"{where}:Filter"}
    config = {"camera": camera, "operator": {"filter": declared}, "process": {"p": process}}
    result = swerve.run("lane", config, set={"ego.speed_mps": 30}, streams=["front.rgb", "filter"])
    before, after = result.streams["front.rgb"], result.streams["filter"]
    assert len(after) == len(before) > 5
    for index in (0, 5):
        expected = before[index].pixels if change == "image" else before[index].pixels // 2
        assert (after[index].pixels == expected).all() and expected.any()


def test_point_clouds_are_published(file: Any) -> None:
    where = file(
        """
        class Ahead(swerve.Operator):
            inputs = {"cloud": messages.PointCloud}
            outputs = {"out": messages.PointCloud}

            def step(self, frame):
                cloud = frame["cloud"]
                ahead = np.asarray(cloud.x_m) > 0
                names = ("x_m", "y_m", "z_m", "intensity", "ring", "time_offset_s")
                return messages.PointCloud(cloud.stamp, *(np.asarray(getattr(cloud, name))[ahead] for name in names))
        """
    )
    declared = {"kind": "python", "inputs": {"cloud": "PointCloud"}, "outputs": {"out": "PointCloud"}}
    process = {"operators": ["ahead"], "python": f"{where}:Ahead"}
    config = {"lidar": {"roof": {}}, "operator": {"ahead": declared}, "process": {"p": process}}
    result = swerve.run("lane", config, set={"ego.speed_mps": 30}, streams=["roof.points", "ahead"])
    before, after = result.streams["roof.points"][3], result.streams["ahead"][3]
    assert 0 < len(after.x_m) < len(before.x_m) and (after.x_m > 0).all() and len(after.ring) == len(after.x_m)


HANGS = """
    class Hangs(swerve.Operator):
        inputs = {"seen": messages.ObstacleList}
        outputs = {"out": messages.ObstacleList}

        def step(self, frame):
            while True:
                pass
"""


def hangs(where: str) -> dict[str, Any]:
    declared = {"kind": "python", "inputs": {"seen": "ObstacleList"}, "outputs": {"out": "ObstacleList"}}
    process = {"operators": ["stuck"], "python": f"{where}:Hangs", "reply_within_s": 600.0}
    return {"operator": {"stuck": declared}, "process": {"p": process}}


def test_a_hung_operator_is_interrupted(file: Any, tmp_path: Path) -> None:
    """Ctrl-C, as a notebook's interrupt: to this process alone; also while a study runs."""
    config = hangs(file(HANGS))
    study = f"swerve.study({{'name': 's', 'base': {{'scenario': 'lane', 'config': 'c.toml'}}, 'axis': [{{'key': 'seed', 'values': [1, 2]}}]}})"
    (tmp_path / "c.toml").write_text(swerve_config_text(config))
    for call in (f"swerve.run('lane', {config!r}, log='drive.mcap')", study):
        # A job in the background of a shell ignores SIGINT, and so would this program.
        heeds = "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)"
        code = f"{heeds}\nimport swerve\nprint('begun', flush=True)\ntry:\n    {call}\nexcept KeyboardInterrupt:\n    print('interrupted')"
        with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, cwd=tmp_path) as program:
            assert program.stdout is not None and program.stdout.readline() == "begun\n"
            time.sleep(5.0)
            program.send_signal(signal.SIGINT)
            try:
                said, _ = program.communicate(timeout=120.0)
            finally:
                program.kill()
            assert said == "interrupted\n" and program.returncode == 0
    assert swerve.read_log(tmp_path / "drive.mcap").streams["pose"]


def swerve_config_text(config: dict[str, Any]) -> str:
    """A configuration as TOML: its tables as inline ones."""
    from swerve.studies import _toml

    return "".join(f"{key} = {_toml(value)}\n" for key, value in config.items())


def test_no_answer_to_a_missed_deadline_is_refused(file: Any) -> None:
    late = {"ms": 50.0, "reaction": "on_deadline"}
    expected = "operator.finder.deadline.reaction: an operator in Python has no answer to a missed deadline: expected"
    with pytest.raises(ValueError, match=expected):
        swerve.run("lane", with_finder(file(FINDER), deadline=late))


def test_run_time_follows_from_the_work_of_a_step(file: Any) -> None:
    where = file(FINDER.replace("seen, ego =", "frame.spend(3); frame.spend(4); seen, ego ="))
    work = {"work": {"base_ms": 1.0, "per_unit_us": 2000.0}}
    finder = swerve.run("person_crossing", with_finder(where, runtime=work)).streams["finder"]
    assert set((finder.visible_at - finder.stamps).tolist()) == {15_000_000}
    with pytest.raises(ValueError, match=r"frame\.spend\(-3\): expected zero or more"):
        swerve.run("lane", with_finder(file(FINDER.replace("seen, ego =", "frame.spend(-3); seen, ego ="))))


def test_an_operator_is_stepped_without_a_run() -> None:
    class Brake(operators.Operator):
        inputs = {"pose": messages.EgoState, "plan": messages.Plan}
        outputs = {"command": messages.Command}

        def step(self, frame: operators.Frame) -> messages.Command | None:
            pose = frame["pose"]
            return None if pose is None else messages.Command(0.0, 0.0, min(1.0, pose.speed_mps))

    ports = [(None, "latest", "pose", "EgoState"), (None, "latest", "planner", "Plan")]
    step = operators.stepper(Brake(), "controller", ports, [(None, "controller", "Command")])
    facts = {"operator": "controller", "now": 5, "stamp": 5, "deadline": None}
    assert step(facts, [[], []]) == (0, [])
    header = dict(stamp=5, visible_at=5, seq=0, watermark=5, reused_from=None, origin=None)
    pose = swerve.run("lane", streams=["pose"]).streams["pose"].plain(3)
    assert step(facts, [[(header, pose)], []]) == (0, [{"steering_rad": 0.0, "throttle": 0.0, "brake": 1.0}])
