"""PPO in NumPy: learns to pass the person behind the truck, without a learning framework.

    python ppo.py [ITERATIONS] [SEED]

The agent gives target speed and offset from the route, each 0.4 s. Policy and value are networks with one hidden layer each.
(Schulman et al., Proximal Policy Optimization Algorithms, 2017.)
"""

import sys
from collections.abc import Callable

import numpy as np

import swerve.gym

DRIVES, STEPS, EPOCHS, BATCH = 16, 48, 8, 128
DISCOUNT, TRACE, CLIP, RATE = 0.97, 0.95, 0.2, 1e-3
HELD = 8  # frames of 50 ms under one action: a shorter one moves the car too little to learn from


class Network:
    """One hidden layer of tanh units, with Adam."""

    def __init__(self, rng: np.random.Generator, inputs: int, outputs: int, hidden: int = 32) -> None:
        self.weights = [rng.normal(0, inputs**-0.5, (inputs, hidden)), np.zeros(hidden)]
        self.weights += [rng.normal(0, 0.01, (hidden, outputs)), np.zeros(outputs)]
        self.more: list[np.ndarray] = []  # weights beside the layers
        self.moments: list[list[np.ndarray]] = []
        self.count = 0

    def forward(self, x: np.ndarray) -> np.ndarray:
        self.x, self.h = x, np.tanh(x @ self.weights[0] + self.weights[1])
        return self.h @ self.weights[2] + self.weights[3]

    def backward(self, slope: np.ndarray, more: list[np.ndarray]) -> None:
        """A step down these slopes, of the outputs of the last `forward` and of the other weights."""
        back = slope @ self.weights[2].T * (1 - self.h**2)
        slopes = [self.x.T @ back, back.sum(0), self.h.T @ slope, slope.sum(0), *more]
        self.moments = self.moments or [[np.zeros_like(each), np.zeros_like(each)] for each in slopes]
        self.count += 1
        for weight, each, (first, second) in zip(self.weights + self.more, slopes, self.moments):
            first += 0.1 * (each - first)
            second += 0.001 * (each**2 - second)
            size = np.sqrt(second / (1 - 0.999**self.count)) + 1e-8
            weight -= RATE * first / (1 - 0.9**self.count) / size


def flat(observation: dict[str, np.ndarray]) -> np.ndarray:
    return np.concatenate([each.reshape(len(each), -1) for each in observation.values()], axis=1).astype(np.float64)


def make(drives: int, scenario: str) -> swerve.gym.DrivingVectorEnv:
    observe = ("route", "pose", "obstacles")
    return swerve.gym.DrivingVectorEnv(
        drives, scenario, level="target", observe=observe, rows=2, normalize=True, autoreset="same_step", threads=2
    )


def hold(env: swerve.gym.DrivingVectorEnv, action: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[str | None], float]:
    """Some frames under one action: the observation after them, rewards, how drives ended, and the largest excess of the target
    speed. A drive that ended has no rewards until the next action."""
    rewards, endings, excess_mps = np.zeros(len(action)), [None] * len(action), 0.0
    for _ in range(HELD):
        observation, reward, _, _, info = env.step(np.clip(action, -1, 1).astype(np.float32))
        goes_on = np.array([ended is None for ended in endings])
        rewards += reward * goes_on
        for facts in (swerve.gym.Facts._make(row) for row in info["facts"][goes_on]):
            excess_mps = max(excess_mps, float(facts.speed_mps - facts.target_speed_mps))
        endings = [was or now for was, now in zip(endings, info.get("ended", endings))]
    return flat(observation), rewards, endings, excess_mps


def update(policy: Network, value: Network, rng: np.random.Generator, data: tuple[np.ndarray, ...]) -> None:
    """Some epochs of the clipped objective over observations, actions, their log-densities, advantages and returns."""
    for _ in range(EPOCHS):
        for part in np.split(rng.permutation(len(data[0])), len(data[0]) // BATCH):
            x, action, before, advantage, target = (each[part] for each in data)
            error = action - policy.forward(x)
            deviation = np.exp(policy.more[0])
            density = (-0.5 * (error / deviation) ** 2 - policy.more[0]).sum(1)
            ratio = np.exp(density - before)
            is_free = np.where(advantage > 0, ratio < 1 + CLIP, ratio > 1 - CLIP)
            pull = (is_free * ratio * advantage / len(part))[:, None]
            spread = -(pull * ((error / deviation) ** 2 - 1)).sum(0) - 1e-3  # a little entropy
            policy.backward(-pull * error / deviation**2, [spread])
            value.backward((value.forward(x)[:, 0] - target)[:, None] / len(part), [])


#: Observations after a step of all drives, their rewards, and how drives ended.
Step = tuple[np.ndarray, np.ndarray, list[str | None]]


def learn(
    seen: np.ndarray, step: Callable[[np.ndarray], Step], rng: np.random.Generator, iterations: int
) -> tuple[Network, list[tuple[int, int]]]:
    """The policy for drives that are stepped together, from their first observations, and for each iteration the drives that
    came to their goal and all that ended."""
    policy, value = Network(rng, seen.shape[1], 2), Network(rng, seen.shape[1], 1)
    policy.more = [np.full(2, np.log(0.4))]
    goals = []
    for iteration in range(iterations):
        rows = []
        for _ in range(STEPS):
            mean, deviation = policy.forward(seen), np.exp(policy.more[0])
            action = mean + deviation * rng.standard_normal(mean.shape)
            density = (-0.5 * ((action - mean) / deviation) ** 2 - policy.more[0]).sum(1)
            after, reward, endings = step(action)
            rows.append((seen, action, density, 0.1 * reward, np.array([one is not None for one in endings]), endings))
            seen = after
        x, actions, densities, rewards, ends, endings = zip(*rows)
        values = [value.forward(each)[:, 0] for each in (*x, seen)]
        advantages, trace = [], np.zeros(len(seen))
        for k in reversed(range(STEPS)):
            goes_on = 1.0 - ends[k]
            trace = rewards[k] + DISCOUNT * values[k + 1] * goes_on - values[k] + DISCOUNT * TRACE * goes_on * trace
            advantages.append(trace)
        advantage = np.concatenate(advantages[::-1])
        target = advantage + np.concatenate(values[:-1])
        scaled = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
        update(policy, value, rng, (np.concatenate(x), np.concatenate(actions), np.concatenate(densities), scaled, target))
        ended = [one for each in endings for one in each if one]
        goals.append((ended.count("goal"), len(ended)))
        print(f"{iteration}: reward {np.mean(rewards) / 0.1:.2f} an action; {ended.count('goal')} of {len(ended)} drives at their goal")
    return policy, goals


def train(
    iterations: int = 60, seed: int = 1, scenario: str = "person_behind_truck"
) -> tuple[Network, list[tuple[int, int]]]:
    """The policy, and for each iteration the drives that came to their goal and all that ended."""
    env = make(DRIVES, scenario)
    seen = flat(env.reset(seed=seed)[0])
    return learn(seen, lambda action: hold(env, action)[:3], np.random.default_rng(seed), iterations)


def drive(policy: Network, seeds: range, scenario: str = "person_behind_truck") -> list[tuple[str, float]]:
    """How drives with the mean action end, and the highest speed in excess of the target of each, m/s."""
    env, results = make(1, scenario), []
    for seed in seeds:
        seen, endings, excess_mps = flat(env.reset(seed=seed)[0]), [None], 0.0
        while endings == [None]:
            seen, _, endings, most_mps = hold(env, policy.forward(seen))
            excess_mps = max(excess_mps, most_mps)
        results.append((str(endings[0]), excess_mps))
    return results


if __name__ == "__main__":
    trained, _ = train(*(int(word) for word in sys.argv[1:3]))
    for ended, excess_mps in drive(trained, range(100, 105)):
        print(f"{ended}, {excess_mps:.1f} m/s over the target speed at most")
