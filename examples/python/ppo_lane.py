"""PPO (`ppo.py`) at the wheel and the pedals: learns to follow roads with bends within their speed limit.

    python ppo_lane.py [ITERATIONS] [SEED]

Each drive has another road. The agent sees the lane and its speed, and gives steering and pedal each 0.1 s. After the
training it drives on roads that were not trained on, beside random actions and constant ones.
"""

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import ppo

import swerve.gym

LIMIT_MPS, GOAL_M = 10.0, 150.0
STEERING_RAD, THROTTLE, BRAKE = 0.1, 0.5, 0.2  # of actions of 1 and -1


def road(seed: int) -> dict[str, Any]:
    """A lane 4 m wide with bends of at least 60 m radius to both sides, and its speed limit as target speed."""
    rng = np.random.default_rng(seed)
    side = rng.choice([-1.0, 1.0])
    segments = [{"length_m": 20.0}]
    for sign in (side, -side):
        bend = {"length_m": float(rng.uniform(30.0, 50.0)), "curvature_1pm": float(sign * rng.uniform(0.008, 0.016))}
        segments += [bend, {"length_m": float(rng.uniform(5.0, 20.0))}]
    return {
        "name": "bends",
        "road": {"segments": [*segments, {"length_m": 200.0}], "lane_width_m": 4.0},
        "ego": {"target_speed_mps": LIMIT_MPS, "start_speed_mps": 5.0, "end_m": GOAL_M},
        "end": {"timeout_s": 40.0},
        "expect": {"verdict": "completed"},
    }


def reward(before: swerve.gym.Facts, action: np.ndarray, after: swerve.gym.Facts) -> float:
    """Metres along the lane; each in excess of the speed limit costs ten, leaving the road 5."""
    excess_m = max(0.0, after.speed_mps - LIMIT_MPS) * (after.time_s - before.time_s)
    return after.s_m - before.s_m - 0.1 * abs(after.d_m) - 10.0 * excess_m - 5.0 * after.left_road


class Drive:
    """A drive that ends where the ego leaves the road, with numbers of about 1 for a network."""

    def __init__(self) -> None:
        set_ = {"control.period_ms": 100}
        self.env = swerve.gym.DrivingEnv(road, level="command", observe=("route", "pose"), set=set_, reward=reward)
        self.route, self.pose = (self.env.observation_fields[name] for name in ("route", "pose"))

    def seen(self, observation: dict[str, np.ndarray]) -> np.ndarray:
        see = dict(zip(self.route + self.pose, np.concatenate([observation["route"], observation["pose"]]).tolist()))
        bends = [100 * see[f"curvature_1pm.{ahead}m"] for ahead in (0, 5, 10)]
        return np.array([see["d_m"], 5 * see["heading_error_rad"], see["speed_mps"] - LIMIT_MPS, 10 * see["steering_rad"], *bends])

    def begin(self, seed: int) -> np.ndarray:
        return self.seen(self.env.reset(seed=seed)[0])

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, str | None, swerve.gym.Facts]:
        steering, pedal = np.clip(action, -1.0, 1.0)
        command = np.array([STEERING_RAD * steering, THROTTLE * max(pedal, 0.0), BRAKE * max(-pedal, 0.0)], np.float32)
        observation, gained, _, _, info = self.env.step(command)
        facts = info["facts"]
        return self.seen(observation), float(gained), "left_road" if facts.left_road else info.get("ended"), facts


def train(iterations: int = 60, seed: int = 1) -> ppo.Network:
    """The policy; roads have the seeds from 1000 on."""
    drives, roads = [Drive() for _ in range(ppo.DRIVES)], iter(range(1000, 10**9))

    def step(actions: np.ndarray) -> ppo.Step:
        after, gained, endings, _ = zip(*(drive.step(action) for drive, action in zip(drives, actions)))
        after = [drive.begin(next(roads)) if end else one for drive, one, end in zip(drives, after, endings)]
        return np.array(after), np.array(gained), list(endings)

    first = np.array([drive.begin(next(roads)) for drive in drives])
    return ppo.learn(first, step, np.random.default_rng(seed), iterations)[0]


def evaluate(policy: Callable[[np.ndarray], np.ndarray], seeds: range) -> list[tuple[str, float, float]]:
    """How drives end, the highest speed of each in excess of the limit, m/s, and its length, seconds."""
    drive, results = Drive(), []
    for seed in seeds:
        seen, ended, excess_mps = drive.begin(seed), None, 0.0
        while ended is None:
            seen, _, ended, facts = drive.step(policy(seen))
            excess_mps = max(excess_mps, facts.speed_mps - LIMIT_MPS)
        results.append((ended, excess_mps, facts.time_s))
    return results


def policies(trained: ppo.Network, seed: int = 1) -> dict[str, Callable[[np.ndarray], np.ndarray]]:
    """The trained policy, and two to compare it with."""
    rng = np.random.default_rng(seed)
    return {
        "trained": lambda seen: trained.forward(seen[None])[0],
        "random": lambda seen: rng.uniform(-1.0, 1.0, 2),
        "constant": lambda seen: np.array([0.0, 0.2]),
    }


if __name__ == "__main__":
    for name, policy in policies(train(*(int(word) for word in sys.argv[1:3]))).items():
        results = evaluate(policy, range(20))
        endings, excesses_mps, lengths_s = zip(*results)
        print(f"{name}: {endings.count('goal')} of {len(endings)} drives at their goal, ", end="")
        print(f"at most {max(excesses_mps):.2f} m/s over the limit, {np.mean(lengths_s):.1f} s on average")
