"""CARLA: the driver and the Leaderboard agent of `examples/carla`, against a stand-in for the module `carla`."""

from __future__ import annotations

import importlib
import importlib.metadata
import math
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from swerve.messages import ActorKind, Command, Signal

ROOT = Path(__file__).resolve().parents[2]
CARLA = ROOT / "examples/carla"
TOWN01 = ROOT.parent / "shared/data/external/carla"
MAPS = {"Town01": TOWN01, "town": ROOT / "scenarios/maps"}
MODULES = ("carla", "carla_frames", "drive", "swerve_agent", "leaderboard")


class Modules:
    """The modules of the example, and those that they find in the place of CARLA's."""

    def __init__(self) -> None:
        self.carla: Any = importlib.import_module("carla")
        self.frames: Any = importlib.import_module("carla_frames")
        self.drive: Any = importlib.import_module("drive")
        self.agent: Any = importlib.import_module("swerve_agent")
        self.evaluation: Any = importlib.import_module("leaderboard.evaluation")

    def world(self, monkeypatch: pytest.MonkeyPatch, town: str = "town", version: str = "0.9.15") -> Any:
        """A world in synchronous mode."""
        monkeypatch.setenv("FAKE_CARLA_MAPS", str(maps(town)))
        monkeypatch.setenv("FAKE_CARLA_VERSION", version)
        world = self.carla.Client().load_world(town)
        world.apply_settings(self.carla.WorldSettings(True, False, 0.05))
        return world

    def car(self, world: Any, place: Any, model: str = "vehicle.lincoln.mkz_2020") -> Any:
        return world.spawn_actor(world.get_blueprint_library().find(model), place)

    def at(self, x: float, y: float, yaw: float = 0.0) -> Any:
        return self.carla.Transform(self.carla.Location(x, y, 0.0), self.carla.Rotation(yaw=yaw))


def maps(town: str) -> Path:
    if not (MAPS[town] / f"{town}.xodr").is_file():
        pytest.skip(f"the map {town} is not here")
    return MAPS[town]


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> Iterator[Modules]:
    monkeypatch.syspath_prepend(CARLA)
    monkeypatch.syspath_prepend(CARLA / "fake")
    known = [name for name in sys.modules if name.split(".")[0] in MODULES]
    for name in known:
        monkeypatch.delitem(sys.modules, name)
    yield Modules()
    for name in [name for name in sys.modules if name.split(".")[0] in MODULES]:
        del sys.modules[name]


def close(found: Any, expected: Any) -> bool:
    return bool(np.allclose(found, expected, rtol=0.0, atol=1e-6))


def test_pose_has_y_to_the_left_and_a_heading_counter_clockwise(here: Modules) -> None:
    pose = here.frames.pose(here.at(10.0, 4.0, 30.0))
    assert close((pose.x_m, pose.y_m, pose.heading_rad), (10.0, -4.0, -math.pi / 6))
    behind = here.frames.pose(here.at(10.0, 4.0, 90.0), -2.0, 1.0)
    assert close((behind.x_m, behind.y_m, behind.heading_rad), (9.0, -2.0, -math.pi / 2))
    assert close(here.frames.wrapped(-math.pi), math.pi) and close(here.frames.wrapped(7.0), 7.0 - 2 * math.pi)


class Moving:
    """A car of CARLA that drives to the south (+y), turns to the right and speeds up."""

    id, type_id, attributes = 7, "vehicle.any", dict[str, str]()

    def __init__(self, here: Modules) -> None:
        self.here, vector = here, here.carla.Vector3D
        self.bounding_box = here.carla.BoundingBox(here.carla.Location(0.5, 0.1, 0.7), vector(2.5, 1.0, 0.75))

    def get_transform(self) -> Any:
        return self.here.at(20.0, 5.0, 90.0)

    def get_velocity(self) -> Any:
        return self.here.carla.Vector3D(-0.3, 6.0, 0.0)

    def get_acceleration(self) -> Any:
        return self.here.carla.Vector3D(-1.2, 0.8, 0.0)

    def get_angular_velocity(self) -> Any:
        return self.here.carla.Vector3D(0.0, 0.0, 9.0)


def test_ego_has_signs_of_a_right_handed_frame(here: Modules) -> None:
    ego = here.frames.ego(5, Moving(here), -0.1)
    assert close((ego.pose.x_m, ego.pose.y_m, ego.pose.heading_rad), (20.0, -5.0 + 1.43, -math.pi / 2))
    assert close((ego.speed_mps, ego.accel_mps2), (6.0, 0.8))
    # To the right, which is west here.
    assert close((ego.lateral_accel_mps2, ego.yaw_rate_radps), (-1.2, -math.radians(9.0)))
    assert ego.steering_rad == -0.1 and ego.stamp == 5


def test_obstacle_has_whole_sizes_and_the_place_of_its_box(here: Modules) -> None:
    found = here.frames.obstacle(Moving(here))
    assert close((found.pose.x_m, found.pose.y_m), (20.0 - 0.1, -(5.0 + 0.5)))
    assert (found.extent.length_m, found.extent.width_m, found.extent.height_m) == (5.0, 2.0, 1.5)
    assert (found.velocity_mps.x, found.velocity_mps.y) == (-0.3, -6.0)
    kinds = {
        ("walker.pedestrian.0001", ""): ActorKind.PEDESTRIAN,
        ("vehicle.any", "bicycle"): ActorKind.CYCLIST,
        ("vehicle.any", "Truck"): ActorKind.TRUCK,
        ("vehicle.any", ""): ActorKind.CAR,
    }
    for (type_id, base), kind in kinds.items():
        actor = Moving(here)
        actor.type_id, actor.attributes = type_id, {"base_type": base}
        assert here.frames.kind(actor) is kind
    actor.attributes = {"number_of_wheels": "2"}
    assert here.frames.kind(actor) is ActorKind.CYCLIST


def test_inertial_unit_and_compass_change_their_signs(here: Modules) -> None:
    imu = here.frames.imu(3, (1.0, 2.0, 9.81), (0.1, 0.2, 0.3))
    assert close(imu.accel_mps2, (1.0, -2.0, 9.81)) and close(imu.gyro_radps, (-0.1, 0.2, -0.3))
    north_east_south = [here.frames.heading(math.radians(each)) for each in (0.0, 90.0, 180.0)]
    assert close(north_east_south, (math.pi / 2, 0.0, -math.pi / 2))


def test_image_has_red_first_and_axes_of_a_camera_that_looks_forward(here: Modules) -> None:
    camera = here.frames.Camera(width_px=2, height_px=1, fov_deg=90.0)
    image = camera.image(9, np.array([10, 20, 30, 255, 1, 2, 3, 255], np.uint8))
    assert image.pixels.tolist() == [[[30, 20, 10], [3, 2, 1]]] and (image.width_px, image.height_px) == (2, 1)
    assert close((image.camera.intrinsics.fx_px, image.camera.intrinsics.cx_px, image.camera.intrinsics.cy_px), (1.0, 1.0, 0.5))
    axes = image.camera.ego_from_camera.matrix()
    assert close(axes[:3, :3], [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]) and close(axes[:3, 3], camera.at_m)


def test_cloud_has_y_to_the_left_rings_from_below_and_ages(here: Modules) -> None:
    older = np.array([[10.0, 3.0, -2.0, 0.5]], np.float32)
    newer = np.array([[10.0, -4.0, 10.0 * math.tan(math.radians(10.0)), 0.25], [1.0, 0.0, -5.0, 1.0]], np.float32)
    cloud = here.frames.Lidar().cloud(4, [(0.05, older), (0.0, newer)])
    assert close(cloud.x_m, (10.0, 10.0, 1.0)) and close(cloud.y_m, (-3.0, 4.0, 0.0)) and cloud.z_m[0] == -2.0
    assert close(cloud.time_offset_s, (-0.05, 0.0, 0.0)) and close(cloud.intensity, (0.5, 0.25, 1.0))
    assert 20 < cloud.ring[0] < 40 and cloud.ring[1] in (62, 63) and cloud.ring[2] == 0


def test_steering_to_the_left_is_negative_and_grows_with_the_speed(here: Modules) -> None:
    steering = here.frames.Steering()
    still, fast = (steering.control(Command(0.1, 0.2, 0.3), speed) for speed in (0.0, 60 / 3.6))
    assert close(still, (0.2, -0.1 / math.radians(70.0), 0.3)) and close(fast[1], still[1] / 0.8)
    assert steering.control(Command(-2.0, 0.0, 0.0), 0.0)[1] == 1.0
    assert close(steering.wheels_rad(fast[1], 60 / 3.6), 0.1)


def test_fixes_have_the_places_of_carla_0_9_16_and_of_those_before(here: Modules) -> None:
    reference = here.frames.GeoReference.of("<geoReference>+lat_0=4.9e+1 +lon_0=8.0000e+0</geoReference>")
    assert (reference.latitude_deg, reference.longitude_deg) == (49.0, 8.0)
    # Points and `transform_to_geolocation` of the map Town01 in the package carla 0.9.16.
    for fix, point in {
        (49.001348004661246, 8.00126563810191): (92.39280700683594, 149.99993896484375),
        (49.00224656441691, 8.005374318336948): (392.3233642578125, 250.00025939941406),
    }.items():
        assert np.allclose(reference.to_map_0_9_16(*fix), (point[0], -point[1]), rtol=0.0, atol=1e-3)
    # Up to 0.9.15 the latitude increases to the north: here, 200 m to the south on a sphere.
    degree_m = math.pi / 180 * 6_378_137.0
    x_m, y_m = reference.to_map(49.0 - 200.0 / degree_m, 8.0 + 100.0 / degree_m / math.cos(math.radians(49.0)))
    assert abs(x_m - 100.0) < 1e-6 and abs(y_m + 200.0) < 0.01
    assert here.frames.GeoReference.of("<header/>") == here.frames.GeoReference(42.0, 2.0)


PACKAGE = """
import math, sys
import carla, carla_frames, numpy, swerve

town = carla.Map("Town01", open(sys.argv[1]).read())
reference = carla_frames.GeoReference.of(town.to_opendrive())
way = {"start": {"x_m": 92.4, "y_m": -150.0, "heading_rad": 1.57}, "goal": {"x_m": 300.0, "y_m": -2.0}}
lanes = swerve.read_map({"name": "t", "map": {"file": sys.argv[1]}, "ego": way, "end": {"timeout_s": 1.0}})
places, fixes, turns = [], [], []
for waypoint in town.generate_waypoints(2.0):
    pose = carla_frames.pose(waypoint.transform)
    fix = town.transform_to_geolocation(waypoint.transform.location)
    fixes.append(math.dist(reference.to_map_0_9_16(fix.latitude, fix.longitude), (pose.x_m, pose.y_m)))
    if not waypoint.is_junction:
        place = lanes.nearest(pose.x_m, pose.y_m)
        lane = lanes[place.lane]
        heading_rad = lane.heading_rad[min(numpy.searchsorted(lane.s_m, place.s_m), len(lane.s_m) - 1)]
        places.append(abs(place.d_m))
        turns.append(abs(carla_frames.wrapped(heading_rad - pose.heading_rad)))
control = carla.VehicleControl(*carla_frames.Steering().control(swerve.messages.Command(0.1, 0.25, 0.5), 0.0))
signals = [carla_frames.signal(getattr(carla.TrafficLightState, name)) for name in ("Green", "Yellow", "Red", "Off", "Unknown")]
assert [signal and signal.value for signal in signals] == ["green", "yellow", "red", "off", None]
assert hasattr(carla.TrafficLight, "get_opendrive_id") and hasattr(carla.TrafficLight, "get_state")
assert (control.throttle, control.brake) == (0.25, 0.5) and abs(control.steer + 0.1 / math.radians(70)) < 1e-6
print(len(fixes), max(fixes), len(places), max(places), math.degrees(max(turns)))
"""


def test_map_and_types_agree_with_the_package_carla() -> None:
    try:
        version = importlib.metadata.version("carla")
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("the package carla is not installed")
    if not version.startswith("0.9.16"):
        pytest.skip("the package carla is not 0.9.16")
    command = [sys.executable, "-c", PACKAGE, str(maps("Town01") / "Town01.xodr")]
    path = os.pathsep.join([str(CARLA), os.environ.get("PYTHONPATH", "")])
    ran = subprocess.run(command, capture_output=True, text=True, check=False, env=os.environ | {"PYTHONPATH": path})
    assert ran.returncode == 0, ran
    fixes, fix_m, places, place_m, turn_deg = map(float, ran.stdout.split())
    assert fixes > 3000 and fix_m < 1e-6 and places > 2000 and place_m < 0.001 and turn_deg < 1.5, ran.stdout


def listened(here: Modules, world: Any, car: Any, kind: str, height_m: float = 2.0, **keys: Any) -> list[Any]:
    """The data of a sensor in the middle of a car."""
    blueprint = world.get_blueprint_library().find(kind)
    for key, value in keys.items():
        blueprint.set_attribute(key, str(value))
    sensor = world.spawn_actor(blueprint, here.carla.Transform(here.carla.Location(z=height_m)), attach_to=car)
    data: list[Any] = []
    sensor.listen(data.append)
    return data


@pytest.mark.parametrize("version", ["0.9.15", "0.9.16"])
def test_all_measurements_of_a_bend_describe_one_motion(here: Modules, monkeypatch: pytest.MonkeyPatch, version: str) -> None:
    frames, world = here.frames, here.world(monkeypatch, version=version)
    car = here.car(world, here.at(300.0, -200.0, 20.0))
    imus, fixes = (listened(here, world, car, f"sensor.other.{kind}", 0.0) for kind in ("imu", "gnss"))
    car._physics.wheels[0].max_steer_angle = 55.0
    car.apply_control(here.carla.VehicleControl(throttle=0.5, steer=0.2))
    for _ in range(40):
        world.tick()
    steering, before = frames.Steering.of(car), frames.ego(0, car, 0.0)
    world.tick()
    wheels_rad = steering.wheels_rad(0.2, car.speed_mps)
    after = frames.ego(50_000_000, car, wheels_rad)
    imu = frames.imu(0, *((v.x, v.y, v.z) for v in (imus[-1].accelerometer, imus[-1].gyroscope)))
    yaw_rate_radps = (after.pose.heading_rad - before.pose.heading_rad) / 0.05
    assert yaw_rate_radps < -0.1  # to the right
    assert close((after.yaw_rate_radps, imu.gyro_radps[2]), yaw_rate_radps)
    assert close(after.speed_mps * math.tan(wheels_rad) / 2.86, yaw_rate_radps)
    assert close((after.lateral_accel_mps2, imu.accel_mps2[1]), after.speed_mps * yaw_rate_radps)
    assert close((after.accel_mps2, imu.accel_mps2[0]), (after.speed_mps - before.speed_mps) / 0.05) and imu.accel_mps2[2] > 9.0
    assert close(frames.heading(imus[-1].compass), after.pose.heading_rad)
    moved = (after.pose.x_m - before.pose.x_m, after.pose.y_m - before.pose.y_m)
    along = (math.cos(before.pose.heading_rad), math.sin(before.pose.heading_rad))
    assert close(moved, np.multiply(along, 0.05 * after.speed_mps))
    reference = frames.GeoReference.of(world.get_map().to_opendrive())
    to_map = reference.to_map if version == "0.9.15" else reference.to_map_0_9_16
    middle = frames.pose(car.get_transform())
    assert np.allclose(to_map(fixes[-1].latitude, fixes[-1].longitude), (middle.x_m, middle.y_m), atol=1e-3)


def test_a_car_to_the_right_is_to_the_right_in_points_and_pixels(here: Modules, monkeypatch: pytest.MonkeyPatch) -> None:
    world = here.world(monkeypatch)
    car = here.car(world, here.at(300.0, -200.0, 90.0))
    here.car(world, here.at(300.0 - 5.0, -200.0 + 12.0, 90.0))  # ahead is +y, to the right is -x
    points = {"channels": 64, "range": 85, "points_per_second": 600_000, "upper_fov": 10, "lower_fov": -30}
    turns = listened(here, world, car, "sensor.lidar.ray_cast", rotation_frequency=20, **points)
    halves = listened(here, world, car, "sensor.lidar.ray_cast", rotation_frequency=10, **points)
    images = listened(here, world, car, "sensor.camera.rgb", image_size_x=100, image_size_y=50, fov=90)
    frame = world.tick()
    assert turns[0].frame == halves[0].frame == images[0].frame == frame
    cloud = here.frames.Lidar().cloud(0, [(0.0, np.frombuffer(turns[0].raw_data, np.float32))])
    tall = cloud.z_m > -1.5
    assert tall.sum() > 50 and abs(np.median(cloud.y_m[tall]) + 5.0) < 1.5 and 9.0 < np.median(cloud.x_m[tall]) < 15.0
    assert (cloud.ring[tall] > cloud.ring[~tall].mean()).mean() > 0.9 and (cloud.y_m > 5.0).any()
    # Half a turn in a frame at 10 Hz: clockwise from ahead, so on the right first.
    half = here.frames.Lidar().cloud(0, [(0.0, np.frombuffer(halves[0].raw_data, np.float32))])
    assert half.y_m.max() < 0.1 and half.y_m.min() < -20.0
    pixels = here.frames.Camera(100, 50, 90.0).image(0, np.frombuffer(images[0].raw_data, np.uint8)).pixels
    red = pixels[25, :, 0] > pixels[25, :, 2] + 50
    assert red.any() and not red[:50].any() and pixels[0, 0, 2] > pixels[0, 0, 0]


def test_the_stand_in_reports_a_collision_once(here: Modules, monkeypatch: pytest.MonkeyPatch) -> None:
    world = here.world(monkeypatch)
    car = here.car(world, here.at(300.0, -200.0))
    other = here.car(world, here.at(320.0, -200.5))
    hits = listened(here, world, car, "sensor.other.collision")
    car.apply_control(here.carla.VehicleControl(throttle=1.0))
    for _ in range(100):
        world.tick()
    assert [hit.other_actor for hit in hits] == [other]
    with pytest.raises(RuntimeError, match="Spawn failed"):
        here.car(world, here.at(320.0, -200.5))


def test_state_of_a_light_is_a_signal(here: Modules) -> None:
    state, signal = here.carla.TrafficLightState, here.frames.signal
    known = [signal(each) for each in (state.Green, state.Yellow, state.Red, state.Off, state.Unknown)]
    assert known == [Signal.GREEN, Signal.YELLOW, Signal.RED, Signal.OFF, None]


LIGHT_WAY, LIGHT, LINE_Y = ("15", "37"), "light_c1_south", -280.5
"""Spawn points in `town` from the south to the north over a crossing, its light, and its stop line (y of CARLA)."""


def set_lights(here: Modules, world: Any, is_red: bool) -> None:
    """All lights of the town but the one on the way are red at first, then green."""
    for light in world.lights():
        red = is_red == (light.get_opendrive_id() == LIGHT)
        light.set_state(here.carla.TrafficLightState.Red if red else here.carla.TrafficLightState.Green)


def front_y(car: Any) -> float:
    return float(car.get_transform().beside(car.bounding_box.extent.x, 0.0).y)


def carlas_layout(folder: Path) -> Path:
    """A copy of `town` as CARLA's own maps have signals: without stop lines, each for the lanes of its references on the roads of
    the junction, 0.62 m behind their begin."""
    tree = ElementTree.parse(maps("town") / "town.xodr")
    connecting = [road for road in tree.iter("road") if road.attrib["junction"] != "-1"]
    for road in [road for road in tree.iter("road") if road.attrib["junction"] == "-1"]:
        for signals in road.findall("signals"):
            for signal in signals.findall("signal"):
                if signal.attrib["type"] in ("294", "341"):
                    signals.remove(signal)
                    continue
                for child in list(signal):
                    signal.remove(child)
                ElementTree.SubElement(signal, "validity", fromLane="0", toLane="0")
                end = {"elementId": road.attrib["id"], "contactPoint": "end" if signal.attrib["orientation"] == "+" else "start"}
                for after in connecting:
                    before = after.find("link/predecessor")
                    if before is None or any(before.attrib[key] != value for key, value in end.items()):
                        continue
                    of = after.find("signals")
                    of = ElementTree.SubElement(after, "signals") if of is None else of
                    at = {"id": signal.attrib["id"], "s": "0.62", "t": "0", "orientation": "+"}
                    reference = ElementTree.SubElement(of, "signalReference", at)
                    ElementTree.SubElement(reference, "validity", fromLane="-4", toLane="-1")
    tree.write(folder / "town.xodr")
    return folder


@pytest.mark.parametrize(("layout", "line_y"), [("town", LINE_Y), ("carla", LINE_Y - 6.12)])
def test_driver_waits_at_a_red_light_and_goes_at_green(
    here: Modules, monkeypatch: pytest.MonkeyPatch, capsys: Any, layout: str, line_y: float, tmp_path: Path
) -> None:
    if layout == "carla":
        monkeypatch.setitem(MAPS, "town", carlas_layout(tmp_path))
    fronts: list[float] = []
    tick = here.carla.World.tick

    def switched(world: Any) -> Any:
        set_lights(here, world, len(fronts) < 600)
        if world.vehicles():
            fronts.append(front_y(world.vehicles()[0]))
        return tick(world)

    monkeypatch.setattr(here.carla.World, "tick", switched)
    words = ("--spawn", LIGHT_WAY[0], "--goal", LIGHT_WAY[1], "--seconds", "42")
    said, _, _ = driven(here, monkeypatch, capsys, "town", *words)
    assert " 0 collisions" in said
    # It waits before the line, as -y is to the north.
    assert line_y < min(fronts[:600]) < line_y + 5.0, min(fronts[:600])
    assert min(fronts) < line_y - 15.0, min(fronts)


def test_driver_stops_at_a_stop_sign_of_the_map(here: Modules, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    passed: list[tuple[float, float, float]] = []
    tick = here.carla.World.tick

    def watched(world: Any) -> Any:
        for car in world.vehicles():
            front = car.get_transform().beside(car.bounding_box.extent.x, 0.0)
            passed.append((front.x, front.y, car.speed_mps))
        return tick(world)

    monkeypatch.setattr(here.carla.World, "tick", watched)
    # To the west, with the line at x = 11.5 m; behind it to the right.
    driven(here, monkeypatch, capsys, "town", "--spawn", "6", "--goal", "33", "--seconds", "40")
    before = [x for x, _, speed_mps in passed[100:] if speed_mps < 0.05]
    assert before and 11.5 < min(before) < 14.5, before[:1]
    assert passed[-1][1] < -160.0, passed[-1]


def lane_margin_m(here: Modules, world: Any, car: Any) -> float:
    """Distance from the car at its rear axle to the nearer border of its lane; negative outside."""
    rear, half_m = here.frames.pose(car.get_transform(), -here.frames.REAR_M), car.bounding_box.extent.y
    margins = [-math.inf]
    for place in world.get_map().lanes.at(rear.x_m, rear.y_m):
        lane = world.get_map().lanes[place.lane]
        heading_rad = lane.heading_rad[min(np.searchsorted(lane.s_m, place.s_m), len(lane.s_m) - 1)]
        if lane.kind == "driving" and math.cos(heading_rad - rear.heading_rad) > 0.8:
            left, right = (float(np.interp(place.s_m, lane.s_m, each)) for each in (lane.left_m, lane.right_m))
            margins.append(min(left - place.d_m, right + place.d_m) - half_m)
    return max(margins)


def driven(here: Modules, monkeypatch: pytest.MonkeyPatch, capsys: Any, town: str, *words: str) -> tuple[str, list[float], float]:
    """Runs the driver: its output, the margins in the lane, and the distance that the car drove."""
    monkeypatch.setenv("FAKE_CARLA_MAPS", str(maps(town)))
    monkeypatch.setattr(sys, "argv", ["drive.py", "--town", town, *words])
    margins: list[float] = []
    lengths: list[float] = []
    tick = here.carla.World.tick

    def watched(world: Any) -> Any:
        frame, car = tick(world), world.vehicles()[0]
        margins.append(lane_margin_m(here, world, car))
        lengths.append(0.05 * car.speed_mps)
        return frame

    monkeypatch.setattr(here.carla.World, "tick", watched)
    here.drive.main()
    return capsys.readouterr().out, margins, sum(lengths)


@pytest.mark.parametrize(("town", "spawn", "goal"), [("Town01", "0", "20"), ("town", "0", "9")])
def test_driver_keeps_its_lane_for_a_minute(
    here: Modules, monkeypatch: pytest.MonkeyPatch, capsys: Any, town: str, spawn: str, goal: str, tmp_path: Path
) -> None:
    words = ("--spawn", spawn, "--goal", goal, "--seconds", "60", "--log", str(tmp_path / "drive.mcap"))
    said, margins, length_m = driven(here, monkeypatch, capsys, town, *words)
    assert "59.95 s, 0 collisions" in said, said
    assert length_m > 250.0 and min(margins) > 0.0, (length_m, min(margins))
    assert (tmp_path / "drive.mcap").is_file()


def test_driver_with_mirrored_steering_leaves_its_lane(here: Modules, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    control = here.frames.Steering.control

    def mirrored(*all: Any) -> tuple[float, float, float]:
        throttle, steer, brake = control(*all)
        return throttle, -steer, brake

    monkeypatch.setattr(here.frames.Steering, "control", mirrored)
    _, margins, _ = driven(here, monkeypatch, capsys, "town", "--spawn", "0", "--goal", "9", "--seconds", "30")
    assert min(margins) < -0.5


def test_driver_avoids_a_car_that_stands_in_its_lane(here: Modules, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    spawn = here.drive.Car.__init__

    def with_another(car: Any, world: Any, blueprint: str, start: Any) -> None:
        spawn(car, world, blueprint, start)
        here.car(world, here.carla.Transform(start.beside(40.0, 0.0), start.rotation), "vehicle.tesla.model3")

    monkeypatch.setattr(here.drive.Car, "__init__", with_another)
    said, _, length_m = driven(here, monkeypatch, capsys, "town", "--spawn", "0", "--goal", "9", "--seconds", "12")
    assert " 0 collisions" in said and length_m > 20.0, (said, length_m)


class Drive:
    """An agent of the Leaderboard on a car in a town."""

    def __init__(
        self, here: Modules, monkeypatch: pytest.MonkeyPatch, town: str, way: list[int], config: str = "", version: str = "0.9.15"
    ) -> None:
        self.here, self.world = here, here.world(monkeypatch, town, version)
        places = [self.world.get_map().get_spawn_points()[index] for index in way]
        self.car = here.car(self.world, places[0])
        self.agent = here.agent.SwerveAgent("localhost", 2000)
        self.agent.setup(config)
        world_plan = [(place, "LANEFOLLOW") for place in places]
        self.agent.set_global_plan(here.evaluation.plan(places, self.world.get_map().origin), world_plan)
        self.collisions = listened(here, self.world, self.car, "sensor.other.collision")
        self.margins: list[float] = []
        self.errors_m: list[float] = []

    def run(self, steps: int, lacking: int = 0) -> None:
        here = self.here.evaluation.Wrapper(self.world, self.car, self.agent)
        here.run(steps, self.look, lacking)

    def look(self, frame: int, now_s: float) -> None:
        self.margins.append(lane_margin_m(self.here, self.world, self.car))
        if self.agent.filter is not None:
            rear, found = self.here.frames.pose(self.car.get_transform(), -1.43), self.agent.filter.pose
            self.errors_m.append(math.dist((rear.x_m, rear.y_m), (found.x_m, found.y_m)))


def test_agent_drives_a_thousand_steps_in_its_lane(here: Modules, monkeypatch: pytest.MonkeyPatch) -> None:
    town, way = ("Town01", [4, 27, 20]) if (TOWN01 / "Town01.xodr").is_file() else ("town", [0, 9])
    drive = Drive(here, monkeypatch, town, way)
    assert here.agent.get_entry_point() == "SwerveAgent" and drive.agent.track.value == "MAP"
    drive.run(1000, lacking=3)
    assert len(drive.margins) == 1000 and not drive.collisions
    assert drive.agent.stack.now_s == pytest.approx(0.05 * 996)
    assert drive.agent.stack.newest("lidar_objects") is not None
    passed = [math.dist(point, (334.9, -20.8)) for point in drive.agent.stack.route]
    assert town == "town" or min(passed) < 5.0
    assert min(drive.margins) > 0.0 and np.mean(drive.errors_m) < 0.25, (min(drive.margins), np.mean(drive.errors_m))
    assert drive.car.speed_mps > 3.0
    drive.agent.destroy()
    assert drive.agent.stack is None


def test_agent_waits_at_a_red_light_in_its_images_and_goes_at_green(here: Modules, monkeypatch: pytest.MonkeyPatch) -> None:
    drive = Drive(here, monkeypatch, "town", [int(each) for each in LIGHT_WAY])
    wrapper, fronts = here.evaluation.Wrapper(drive.world, drive.car, drive.agent), []
    for k in range(650):
        set_lights(here, drive.world, k < 450)
        wrapper.run(1, drive.look)
        fronts.append(front_y(drive.car))
    assert not drive.collisions and LINE_Y < min(fronts[:450]) < LINE_Y + 5.0, min(fronts[:450])
    assert fronts[-1] < LINE_Y - 10.0, fronts[-1]


def test_agent_avoids_a_car_that_its_lidar_sees(here: Modules, monkeypatch: pytest.MonkeyPatch) -> None:
    drive = Drive(here, monkeypatch, "town", [0, 9])
    start = drive.car.get_transform()
    here.car(drive.world, here.carla.Transform(start.beside(45.0, 0.0), start.rotation), "vehicle.tesla.model3")
    drive.run(240)
    assert not drive.collisions and drive.car.get_location().distance(start.location) > 15.0


@pytest.mark.parametrize("version", ["0.9.15", "0.9.16"])
def test_agent_finds_the_projection_of_the_receiver_and_drives_without_compass(
    here: Modules, monkeypatch: pytest.MonkeyPatch, version: str
) -> None:
    drive = Drive(here, monkeypatch, "town", [0, 9], "", version)
    wrapper = here.evaluation.Wrapper(drive.world, drive.car, drive.agent)
    wrapper.run(20, drive.look)
    sense = drive.agent.run_step

    def blind(data: dict[str, Any], timestamp: float) -> Any:
        data["imu"][1][6] = math.nan
        return sense(data, timestamp)

    monkeypatch.setattr(drive.agent, "run_step", blind)
    wrapper.run(1, drive.look)
    heading_rad = drive.agent.filter.pose.heading_rad
    assert abs(here.frames.wrapped(heading_rad - here.frames.pose(drive.car.get_transform()).heading_rad)) < 0.01
    assert max(drive.errors_m) < 2.5
    assert drive.agent.to_map.__name__ == ("to_map" if version == "0.9.15" else "to_map_0_9_16")


def test_sensors_are_those_that_the_configuration_reads(here: Modules, monkeypatch: pytest.MonkeyPatch) -> None:
    drive = Drive(here, monkeypatch, "town", [0, 9], "camera_objects")
    assert [each["id"] for each in drive.agent.sensors()] == ["front", "imu", "gnss", "speed", "map"]
    drive.run(12)
    assert drive.agent.stack.newest("front.rgb").width_px == 800
    assert [each["id"] for each in Drive(here, monkeypatch, "town", [0, 9]).agent.sensors()][:2] == ["signals", "roof"]


def test_agent_of_version_1_is_set_up_by_its_constructor(here: Modules) -> None:
    agent = here.agent.SwerveAgent("lidar_objects")
    assert agent.config == "lidar_objects" and agent.track.value == "MAP"
    waiting = {"gnss": (1, np.zeros(3)), "imu": (1, np.zeros(7)), "speed": (1, {"speed": 0.0})}
    assert agent.run_step(waiting, 0.0).brake == 1.0
    agent.destroy()


def test_driver_names_a_missing_spawn_point_and_a_silent_sensor(
    here: Modules, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    with pytest.raises(SystemExit, match="--spawn, --goal: town has [0-9]+ spawn points"):
        driven(here, monkeypatch, capsys, "town", "--spawn", "0", "--goal", "999")
    monkeypatch.setattr(here.drive, "TIMEOUT_S", 0.1)
    monkeypatch.setattr(here.carla.Sensor, "sense", lambda *_: None)
    with pytest.raises(SystemExit, match="sensor imu: no data of frame 1002 in 0.1 s"):
        driven(here, monkeypatch, capsys, "town", "--spawn", "0", "--goal", "9")


def test_sensors_are_placed_from_the_middle_of_the_car_with_y_to_the_right(
    here: Modules, monkeypatch: pytest.MonkeyPatch
) -> None:
    place_m = (here.frames.REAR_M + 0.5, 0.4, 2.0)
    world = here.world(monkeypatch)
    car = here.drive.Car(world, "vehicle.lincoln.mkz_2020", here.at(300.0, -200.0, 0.0))
    at = car.add("sensor.camera.rgb", place_m, {}).get_transform().location
    assert close((at.x, at.y, at.z), (300.5, -200.4, 2.0))
    monkeypatch.setattr(here.agent, "LIDAR", here.frames.Lidar(at_m=place_m))
    [roof] = [each for each in here.agent.SwerveAgent("lidar_objects").sensors() if each["id"] == "roof"]
    assert close((roof["x"], roof["y"], roof["z"]), (0.5, -0.4, 2.0))
