"""Crash rates in highway-env (`pip install highway-env`): the stack of Swerve beside highway-env's own IDM car.

    python highway_table.py [EPISODES] [ENVIRONMENT ...]

prints the table with a test of the crashes, and each episode to standard error.

The worlds have the default settings of highway-env, with 15 steps a second, but an episode at the crossing takes up to 60 s in
place of 13 s: a driver that gives way may wait there for longer. The stack moves the car in each step, not once per action of
the environment, which is a second: environments spawn traffic once per action. highway-env has y and angles to the right, Swerve
to the left: y, heading and steering change their signs.
"""

import math
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import highway_env
import numpy as np
from highway_env.road.road import Road
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.controller import ControlledVehicle
from highway_env.vehicle.kinematics import Vehicle

import swerve
from swerve.messages import ActorKind, EgoState, Extent, Obstacle, Pose2, Vector2

HZ, REAR_M, LIMIT_MPS2, LIMIT_RAD = 15, 1.425, 5.0, math.pi / 4
WHEELBASE_M, CROSSING_S = 2.85, 60.0
ENVIRONMENTS = ("highway-v0", "merge-v1", "intersection-v1")


class Episode(NamedTuple):
    """Result of an episode."""

    crashed: bool
    is_through: bool
    """True if the ego reached the end of its way: across the intersection, past the ramp, or the end of the time on the highway."""
    seconds: float
    mean_mps: float


class Car(ControlledVehicle):
    """A car that another program moves in each step. Others expect it on its route, as every car of highway-env."""

    moves: Callable[[], dict[str, float]] | None = None
    """Returns acceleration (m/s²) and steering angle (radians) for the next step."""

    def act(self, action: Any = None) -> None:
        if action is None and self.moves:
            Vehicle.act(self, self.moves())


class StraightRoad(Road):
    """The road of `highway-v0`, lanes along x, with the same neighbours and collisions in less than a third of the time."""

    def neighbour_vehicles(self, vehicle: Vehicle, lane_index: Any = None) -> tuple[Vehicle | None, Vehicle | None]:
        lane = self.network.get_lane(lane_index or vehicle.lane_index)
        (x0, y0), reach_m, beyond_m = lane.start.tolist(), lane.width / 2 + 1.0, lane.VEHICLE_LENGTH
        s, front, rear = float(vehicle.position[0]) - x0, (math.inf, None), (-math.inf, None)
        for other in self.vehicles:
            x, y = other.position.tolist()
            at = x - x0
            if other is vehicle or abs(y - y0) > reach_m or not -beyond_m <= at < lane.length + beyond_m:
                continue
            if s <= at <= front[0]:
                front = (at, other)
            if s > at > rear[0]:
                rear = (at, other)
        return front[1], rear[1]

    def step(self, dt: float) -> None:
        for vehicle in self.vehicles:
            vehicle.step(dt)
        xs = [float(vehicle.position[0]) for vehicle in self.vehicles]
        for i, vehicle in enumerate(self.vehicles):
            for j in range(i + 1, len(xs)):
                if abs(xs[i] - xs[j]) < 20.0:  # two lengths of a car and a step at 100 m/s
                    vehicle.handle_collisions(self.vehicles[j], dt)


def make(name: str, seed: int, driver: type[Vehicle]) -> Any:
    """An environment in which a car of this class has the place of the ego."""
    gymnasium.register_envs(highway_env)
    config = {"action": {"type": "DiscreteMetaAction"}} | ({"duration": CROSSING_S} if name.startswith("intersection") else {})
    env = gymnasium.make(name, config=config).unwrapped
    if env.config["simulation_frequency"] != HZ:
        raise ValueError(f"{name}: expected {HZ} steps a second, found {env.config['simulation_frequency']}")
    env.reset(seed=seed)
    env.route = list(env.vehicle.route or [])
    if name == "highway-v0":
        env.road.__class__ = StraightRoad
    car = driver.create_from(env.vehicle)
    env.road.vehicles[env.road.vehicles.index(env.vehicle)] = car
    env.controlled_vehicles[0] = car
    env.action_type.controlled_vehicle = car
    return env


def ended(env: Any, terminated: bool, speeds: list[float]) -> Episode:
    crashed = bool(env.vehicle.crashed)
    is_through = not crashed and (terminated or not env.route)
    return Episode(crashed, is_through, float(env.time), float(np.mean(speeds)))


def idle(env: Any) -> int:
    """The action of the environment that leaves its ego alone."""
    return next(number for number, action in env.action_type.actions.items() if action == "IDLE")


def idm(name: str, seed: int) -> Episode:
    """An episode of highway-env's own driver: car following (IDM) and lane changes (MOBIL)."""
    env = make(name, seed, IDMVehicle)
    speeds = []
    while True:
        *_, terminated, truncated, _ = env.step(idle(env))
        speeds.append(float(env.vehicle.speed))
        if terminated or truncated:
            return ended(env, terminated, speeds)


def line(lane: Any, lateral_m: float) -> list[tuple[float, float]]:
    """Points of a lane from its begin to its end, 2 m apart, right-handed; `lateral_m` is to the right."""
    count = max(2, math.ceil(float(lane.length) / 2.0) + 1)
    places = (lane.position(float(s), lateral_m) for s in np.linspace(0.0, float(lane.length), count))
    return [(float(x), -float(y)) for x, y in places]


def crossing(env: Any) -> str:
    """The crossing of `intersection-v1` as a map of CommonRoad. The roads with the lower priority have signs to give way."""
    graph = env.road.network.graph
    lanes = [(a, b, lane) for a in graph for b in graph[a] for lane in graph[a][b]]
    ids = {(a, b): number for number, (a, b, _) in enumerate(lanes, 1)}
    yields = max(lane.priority for *_, lane in lanes) - 1
    text = '<commonRoad commonRoadVersion="2020a" timeStepSize="0.1" benchmarkID="ZAM_Crossing-1_1_T-1">'
    for a, b, lane in lanes:
        text += f'<lanelet id="{ids[a, b]}">'
        for name, lateral_m in (("leftBound", -lane.width / 2), ("rightBound", lane.width / 2)):
            points = (f"<point><x>{x}</x><y>{y}</y></point>" for x, y in line(lane, float(lateral_m)))
            text += f"<{name}>{''.join(points)}</{name}>"
        text += "".join(f'<predecessor ref="{ids[one]}"/>' for one in ids if one[1] == a)
        text += "".join(f'<successor ref="{ids[one]}"/>' for one in ids if one[0] == b)
        if a[0] == "o" and lane.priority < yields:
            text += '<stopLine><trafficSignRef ref="100"/></stopLine>'
        text += "<laneletType>urban</laneletType></lanelet>"
    text += '<trafficSign id="100"><trafficSignElement><trafficSignID>205</trafficSignID></trafficSignElement></trafficSign>'
    text += '<intersection id="101">'
    for k in range(4):
        turns = (("Right", -1), ("Straight", 2), ("Left", 1))
        inside = (f'<successors{name} ref="{ids[f"ir{k}", f"il{(k + turn) % 4}"]}"/>' for name, turn in turns)
        text += f'<incoming id="{110 + k}"><incomingLanelet ref="{ids[f"o{k}", f"ir{k}"]}"/>{"".join(inside)}</incoming>'
    return text + "</intersection></commonRoad>"


def way(env: Any, folder: Path) -> dict[str, Any]:
    """Arguments of the stack for the ego's way: over a map of the crossing, else along the centres of lanes."""
    network, at = env.road.network, env.vehicle.lane_index
    if "ir0" in network.graph:
        (folder / "crossing.xml").write_text(crossing(env))
        x, y = env.vehicle.position
        goal = line(network.get_lane((*env.route[-1][:2], 0)), 0.0)[-2]
        return {"map": folder / "crossing.xml", "start": (float(x), -float(y)), "goal": goal}
    lanes, left, right = [at], 0, 0
    if env.route:
        lanes = [(a, b, number or 0) for a, b, number in env.route]
    else:
        left, right = at[2], len(network.graph[at[0]][at[1]]) - 1 - at[2]
    while not env.route and lanes[-1][1] in network.graph:
        _, b, number = lanes[-1]
        after = next(iter(network.graph[b]))
        lanes.append((b, after, min(number, len(network.graph[b][after]) - 1)))
    points: list[tuple[float, float]] = []
    for index in lanes:
        lane = network.get_lane(index)
        length_m = min(float(lane.length), 2000.0)
        for s in np.linspace(0.0, length_m, max(2, round(length_m / (2.0 if length_m < 100 else 20.0)) + 1)):
            x, y = lane.position(float(s), 0.0)
            if not points or math.hypot(x - points[-1][0], -y - points[-1][1]) > 0.5:
                points.append((float(x), -float(y)))
    return {"route": points, "lane_width_m": 4.0, "lanes_left": left, "lanes_right": right}


def stack(name: str, seed: int) -> Episode:
    """An episode of Swerve's stack, with perfect perception and the modelled run times."""
    env = make(name, seed, Car)
    car = env.vehicle
    target_mps = 25.0 if name.startswith("highway") else 20.0 if name.startswith("merge") else 9.0
    # With the cars themselves: the identity of a car that is gone is not used again.
    ids: dict[int, tuple[int, Any]] = {}
    speeds: list[float] = []

    def ego(stamp: int) -> EgoState:
        heading, (x, y) = -float(car.heading), car.position
        pose = Pose2(float(x) - REAR_M * math.cos(heading), -float(y) - REAR_M * math.sin(heading), heading)
        speed, steering = float(car.speed), -float(car.action["steering"])
        yaw = speed * math.tan(steering) / WHEELBASE_M
        return EgoState(stamp, pose, speed, float(car.action["acceleration"]), speed * yaw, yaw, steering)

    def others() -> list[Obstacle]:
        found = []
        for one in env.road.vehicles:
            if one is not car:
                number = ids.setdefault(id(one), (len(ids) + 1, one))[0]
                pose = Pose2(float(one.position[0]), -float(one.position[1]), -float(one.heading))
                v = Vector2(float(one.velocity[0]), -float(one.velocity[1]))
                found.append(Obstacle(number, ActorKind.CAR, pose, Extent(one.LENGTH, one.WIDTH, 1.5), v, 1.0))
        return sorted(found, key=lambda o: o.id)

    with tempfile.TemporaryDirectory() as folder:
        driver = swerve.Stack(speed_mps=target_mps, **way(env, Path(folder)))

    def moves() -> dict[str, float]:
        k = len(speeds)
        speeds.append(float(car.speed))
        driver.feed_scene(ego(k * 10**9 // HZ), others())
        command = driver.advance_to(k / HZ)
        accel_mps2 = 3.0 * command.throttle - 8.0 * command.brake if car.speed > 0.0 or command.throttle else 0.0
        accel_mps2 = min(max(accel_mps2, -LIMIT_MPS2), LIMIT_MPS2)
        return {"acceleration": accel_mps2, "steering": min(max(-command.steering_rad, -LIMIT_RAD), LIMIT_RAD)}

    car.moves = moves
    while True:
        *_, terminated, truncated, _ = env.step(idle(env))
        if terminated or truncated:
            return ended(env, terminated, speeds)


def wilson(crashes: int, episodes: int) -> tuple[float, float]:
    """95 % interval of a share, percent."""
    z, p = 1.96, crashes / episodes
    middle, half = p + z * z / (2 * episodes), z * math.sqrt(p * (1 - p) / episodes + z * z / (4 * episodes**2))
    low, high = (100 * (middle + sign * half) / (1 + z * z / episodes) for sign in (-1, 1))
    return max(low, 0.0), high


def mcnemar(one: list[Episode], other: list[Episode]) -> tuple[int, int, float]:
    """Seeds in which only the one driver crashes, and only the other, and the exact probability of so uneven counts under equal
    crash rates (McNemar's test, two-sided)."""
    pairs = [(a.crashed, b.crashed) for a, b in zip(one, other)]
    first, second = pairs.count((True, False)), pairs.count((False, True))
    n = first + second
    return first, second, min(1.0, 2.0 * sum(math.comb(n, k) for k in range(min(first, second) + 1)) / 2.0**n)


if __name__ == "__main__":
    episodes = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    print("| environment | driver | crashes | crash rate (95 % interval) | through | mean speed |\n|---|---|---|---|---|---|")
    tests = []
    with ProcessPoolExecutor() as pool:
        for name in sys.argv[2:] or ENVIRONMENTS:
            both = []
            for label, drive in (("Swerve", stack), ("IDM", idm)):
                found: list[Episode] = []
                for episode in pool.map(partial(drive, name), range(episodes)):
                    print(name, label, len(found), *episode, sep=",", file=sys.stderr, flush=True)
                    found.append(episode)
                crashes, through = sum(one.crashed for one in found), sum(one.is_through for one in found)
                low, high = wilson(crashes, episodes)
                rate = f"{100 * crashes / episodes:.1f} % ({low:.1f} to {high:.1f})"
                speed = f"{np.mean([one.mean_mps for one in found]):.1f} m/s"
                print(f"| `{name}` | {label} | {crashes} of {episodes} | {rate} | {through} | {speed} |", flush=True)
                both.append(found)
            first, second, p = mcnemar(*both)
            tests.append(f"{name}: only Swerve crashes in {first} episodes, only IDM in {second}; McNemar's exact test: p = {p:.3f}")
    print("", *tests, sep="\n")
