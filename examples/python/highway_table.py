"""Crash rates in highway-env (`pip install highway-env`): the stack of Swerve beside highway-env's own IDM car.

    python highway_table.py [EPISODES] [ENVIRONMENT ...]

prints the table, and each episode to standard error.

The worlds are those of highway-env as they are, with 15 steps a second; both drivers get the same ones. highway-env has y and
angles to the right, Swerve to the left: y, heading and steering change their signs.
"""

import math
import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import Any, NamedTuple

import gymnasium
import highway_env
import numpy as np
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle

import swerve
from swerve.messages import ActorKind, EgoState, Extent, Obstacle, Pose2, Vector2

HZ, REAR_M, LIMIT_MPS2, LIMIT_RAD = 15, 1.425, 5.0, math.pi / 4
WHEELBASE_M = 2.85
ENVIRONMENTS = ("highway-v0", "merge-v1", "intersection-v1")


class Episode(NamedTuple):
    """What became of one episode."""

    crashed: bool
    is_through: bool
    """True if the ego came to the end of its way: across the intersection, past the ramp, or through the time on the highway."""
    seconds: float
    mean_mps: float


class Car(Vehicle):
    """A car whose pedals and steering another program moves; the environment's own actions do not."""

    def act(self, action: Any = None) -> None:
        if isinstance(action, dict):
            super().act(action)


def make(name: str, seed: int, driver: type[Vehicle]) -> Any:
    """An environment in which a car of this class has the place of the ego."""
    gymnasium.register_envs(highway_env)
    steps = {"simulation_frequency": HZ, "policy_frequency": HZ}
    env = gymnasium.make(name, config={**steps, "action": {"type": "DiscreteMetaAction"}}).unwrapped
    env.reset(seed=seed)
    env.route = list(env.vehicle.route or [])
    car = driver.create_from(env.vehicle)
    env.road.vehicles[env.road.vehicles.index(env.vehicle)] = car
    env.controlled_vehicles[0] = car
    env.action_type.controlled_vehicle = car
    return env


def ended(env: Any, terminated: bool, speeds: list[float]) -> Episode:
    crashed = bool(env.vehicle.crashed)
    is_through = not crashed and (terminated or not env.route)
    return Episode(crashed, is_through, len(speeds) / HZ, float(np.mean(speeds)))


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


def way(env: Any) -> tuple[list[tuple[float, float]], int, int]:
    """Centres of the lanes that the ego follows, right-handed, and the number of lanes to its left and right."""
    network, at = env.road.network, env.vehicle.lane_index
    lanes, beside = [at], (0, 0)
    if env.route:
        lanes = [(a, b, number or 0) for a, b, number in env.route]
    else:
        beside = (at[2], len(network.graph[at[0]][at[1]]) - 1 - at[2])
        while lanes[-1][1] in network.graph:
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
    return points, *beside


def stack(name: str, seed: int) -> Episode:
    """An episode of Swerve's stack, with perfect perception and the modelled run times."""
    env = make(name, seed, Car)
    car = env.vehicle
    route, left, right = way(env)
    target_mps = 25.0 if name.startswith("highway") else 20.0 if name.startswith("merge") else 9.0
    ids: dict[int, int] = {}
    speeds = []

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
                number = ids.setdefault(id(one), len(ids) + 1)
                pose = Pose2(float(one.position[0]), -float(one.position[1]), -float(one.heading))
                v = Vector2(float(one.velocity[0]), -float(one.velocity[1]))
                found.append(Obstacle(number, ActorKind.CAR, pose, Extent(one.LENGTH, one.WIDTH, 1.5), v, 1.0))
        return sorted(found, key=lambda o: o.id)

    lanes = {"lane_width_m": 4.0, "lanes_left": left, "lanes_right": right}
    driver = swerve.Stack(route=route, speed_mps=target_mps, **lanes)
    for k in range(100 * HZ):
        driver.feed_scene(ego(k * 10**9 // HZ), others())
        command = driver.advance_to(k / HZ)
        accel_mps2 = 3.0 * command.throttle - 8.0 * command.brake if car.speed > 0.0 or command.throttle else 0.0
        accel_mps2 = min(max(accel_mps2, -LIMIT_MPS2), LIMIT_MPS2)
        car.act({"acceleration": accel_mps2, "steering": min(max(-command.steering_rad, -LIMIT_RAD), LIMIT_RAD)})
        *_, terminated, truncated, _ = env.step(idle(env))
        speeds.append(float(car.speed))
        if terminated or truncated:
            break
    return ended(env, terminated, speeds)


def wilson(crashes: int, episodes: int) -> tuple[float, float]:
    """95 % interval of a share, percent."""
    z, p = 1.96, crashes / episodes
    middle, half = p + z * z / (2 * episodes), z * math.sqrt(p * (1 - p) / episodes + z * z / (4 * episodes**2))
    low, high = (100 * (middle + sign * half) / (1 + z * z / episodes) for sign in (-1, 1))
    return max(low, 0.0), high


if __name__ == "__main__":
    episodes = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    print("| environment | driver | crashes | crash rate (95 % interval) | through | mean speed |\n|---|---|---|---|---|---|")
    with ProcessPoolExecutor() as pool:
        for name in sys.argv[2:] or ENVIRONMENTS:
            for label, drive in (("Swerve", stack), ("IDM", idm)):
                found = []
                for episode in pool.map(partial(drive, name), range(episodes)):
                    print(name, label, len(found), *episode, sep=",", file=sys.stderr, flush=True)
                    found.append(episode)
                crashes, through = sum(one.crashed for one in found), sum(one.is_through for one in found)
                low, high = wilson(crashes, episodes)
                rate = f"{100 * crashes / episodes:.1f} % ({low:.1f} to {high:.1f})"
                speed = f"{np.mean([one.mean_mps for one in found]):.1f} m/s"
                print(f"| `{name}` | {label} | {crashes} of {episodes} | {rate} | {through} | {speed} |", flush=True)
