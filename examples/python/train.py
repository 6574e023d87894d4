"""Learns to steer along a lane with bends, by the cross-entropy method and without a framework."""

import sys

import numpy as np

import swerve.gym

SECONDS = 18.0
GOAL_MPS = 8.0


def drive(env: swerve.gym.DrivingEnv, gains: np.ndarray, seed: int) -> float:
    """The sum of rewards under a linear steering law, until the ego leaves the road."""
    names = env.observation_fields["route"]
    observation, _ = env.reset(seed=seed)
    total = 0.0
    for _ in range(int(SECONDS / env.period_s)):
        seen = dict(zip(names, observation["route"]))
        features = np.array([seen["d_m"], seen["heading_error_rad"], 10 * seen["curvature_1pm.5m"]])
        speed = observation["pose"][env.observation_fields["pose"].index("speed_mps")]
        pedal = 0.5 * (GOAL_MPS - speed)
        action = np.array([features @ gains, np.clip(pedal, 0, 1), np.clip(-pedal, 0, 1)], np.float32)
        action = np.clip(action, env.action_space.low, env.action_space.high)
        observation, reward, terminated, truncated, info = env.step(action)
        total += float(reward)
        if terminated or truncated or info["facts"].left_road:
            break
    return total


def train(generations: int = 10, population: int = 16, seed: int = 1) -> tuple[float, float]:
    """Gives what the mean of all gains came to before and after."""
    rng = np.random.default_rng(seed)
    env = swerve.gym.DrivingEnv("lane", observe=("route", "pose"))
    mean, deviation = np.zeros(3), np.full(3, 0.5)
    first = drive(env, mean, seed)
    for generation in range(generations):
        tried = mean + deviation * rng.standard_normal((population, 3))
        rewards = np.array([drive(env, gains, seed) for gains in tried])
        best = tried[np.argsort(rewards)[-population // 4 :]]
        mean, deviation = best.mean(axis=0), best.std(axis=0) + 0.02
        print(f"generation {generation}: best {rewards.max():.1f}, gains {np.round(mean, 2)}")
    last = drive(env, mean, seed)
    print(f"from {first:.1f} to {last:.1f}")
    return first, last


if __name__ == "__main__":
    train(*(int(word) for word in sys.argv[1:]))
