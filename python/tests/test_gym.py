"""Environments: Gymnasium's own checks, bit-equal drives, and an agent that learns."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings
from typing import Any

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")
import swerve  # noqa: E402
import swerve.gym  # noqa: E402
from gymnasium.utils.env_checker import check_env  # noqa: E402

CAMERA = {"camera": {"front": {"width_px": 32, "height_px": 16, "period_ms": 500}}, "log": {"sensors": ["front"]}}


@pytest.mark.parametrize("level", ["command", "plan", "target"])
@pytest.mark.parametrize("observe", ["pose", ("route", "tracker", "predictor", "imu", "world", "obstacles")])
def test_the_checker_is_content(level: str, observe: Any) -> None:
    env = gymnasium.make("swerve/PersonBehindTruck-v0", level=level, observe=observe)
    with warnings.catch_warnings():
        # What it warns of is that numbers have no bounds, and that actions are in SI units and not within -1 and 1.
        warnings.simplefilter("ignore", UserWarning)
        check_env(env.unwrapped, skip_render_check=True)


def test_images_are_observed() -> None:
    env = gymnasium.make("swerve/Lane-v0", config=CAMERA, observe=("front.rgb", "front.depth", "pose"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        check_env(env.unwrapped, skip_render_check=True)
    observation, _ = env.reset(seed=1)
    for _ in range(60):
        observation, *_ = env.step(env.action_space.sample())
    assert observation["front.rgb"].shape == (16, 32, 3) and observation["front.rgb"].any()


def test_environments_are_known_without_an_import() -> None:
    """Gymnasium imports the module that stands before the name."""
    code = """if True:
        import gymnasium
        env = gymnasium.make("swerve.gym:swerve/PersonBehindTruck-v0", observe="pose")
        assert env.reset(seed=1)[0].shape == (8,)
        envs = gymnasium.make_vec(
            "swerve.gym:swerve/Lane-v0", num_envs=2, vectorization_mode="vector_entry_point", observe="pose"
        )
        assert envs.reset(seed=1)[0].shape == (2, 8)
        for name in ["swerve/Lane-v0", "swerve/EverydayStartInJam-v0"]:
            assert type(gymnasium.make(name).unwrapped).__module__ == "swerve.gym"
    """
    subprocess.run([sys.executable, "-c", code], check=True)


def drive(env: Any, seed: int, steps: int = 300) -> list[bytes]:
    env.action_space.seed(seed)
    observation, _ = env.reset(seed=seed)
    seen = [np.asarray(observation).tobytes()]
    for _ in range(steps):
        observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
        seen.append(np.asarray(observation).tobytes() + np.float64(reward).tobytes())
        if terminated or truncated:
            break
    return seen


def test_equal_seeds_are_equal_drives() -> None:
    one, other = (swerve.gym.DrivingEnv("person_crossing", observe="pose") for _ in range(2))
    assert drive(one, 5) == drive(other, 5) == drive(one, 5)
    assert drive(one, 5)[0] != drive(one, 6)[0], "another seed begins elsewhere"


def test_an_agent_that_repeats_a_run_drives_it_again() -> None:
    """The commands of our own controller, given by an agent, come to the same world, bit for bit."""
    run = swerve.run("person_behind_truck", seed=2)
    commands = run.streams["controller"]
    actions = np.stack([commands[name] for name in ("steering_rad", "throttle", "brake")], axis=1)
    by_stamp = dict(zip(commands.stamps.tolist(), actions))
    truth = {message.stamp: message.ego.state for message in run.streams["world"]}
    drives = swerve._swerve.Drives("person_behind_truck", "command", ["world"])
    _, facts = drives.reset(2)
    compared = 0
    while True:
        told = swerve.gym.Facts._make(np.frombuffer(facts, np.float64).tolist())
        stamp = round(told.time_s * 1e9)
        assert told.speed_mps == truth[stamp].speed_mps and told.accel_mps2 == truth[stamp].accel_mps2
        compared += 1
        if told.ended:
            break
        # Before its first command the car is left alone.
        _, facts = drives.step([float(number) for number in by_stamp.get(stamp, np.zeros(3))])
    assert compared > 300 and drives.ended(0) == run.streams["world"]["ended"][-1]


def test_the_end_of_a_drive_is_told() -> None:
    env = swerve.gym.DrivingEnv("lane", level="target", observe="route")
    env.reset(seed=1)
    for _ in range(2000):
        _, _, terminated, truncated, info = env.step(np.array([15.0, 0.0], np.float32))
        if terminated or truncated:
            break
    assert terminated and info["ended"] == "goal" and not truncated
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.array([15.0, 0.0], np.float32))


def test_a_vector_of_drives_is_as_many_single_ones() -> None:
    vector = gymnasium.make_vec(
        "swerve/PersonCrossing-v0", num_envs=3, vectorization_mode="vector_entry_point", observe="pose", threads=2
    )
    assert vector.observation_space.shape == (3, 8)
    observations, _ = vector.reset(seed=[7, 8, 9])
    singles = [swerve.gym.DrivingEnv("person_crossing", observe="pose") for _ in range(3)]
    for index, single in enumerate(singles):
        assert (single.reset(seed=7 + index)[0] == observations[index]).all()
    vector.action_space.seed(1)
    over = [False] * 3
    for _ in range(400):
        actions = vector.action_space.sample()
        observations, rewards, terminated, truncated, _ = vector.step(actions)
        for index, single in enumerate(singles):
            if over[index]:
                continue
            observation, reward, t, u, _ = single.step(actions[index])
            assert (observation == observations[index]).all() and reward == rewards[index]
            assert (t, u) == (terminated[index], truncated[index])
            over[index] = t or u
    vector.reset(seed=1)
    whole = [vector.step(vector.action_space.sample())[0].tobytes() for _ in range(900)]
    assert len(set(whole)) > 800, "drives that are over begin anew"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"level": "pedal"}, "level: expected command, plan or target"),
        ({"observe": "poze"}, "did you mean `pose`"),
        ({"set": {"gate.enabled": True}}, "gate.enabled"),
        ({"rows": 0}, "rows"),
        ({"render_mode": "human"}, "render_mode: expected rgb_array"),
    ],
)
def test_what_is_wrong_is_told(arguments: dict[str, Any], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        swerve.gym.DrivingEnv("lane", **arguments)
    env = swerve.gym.DrivingEnv("lane")
    env.reset(seed=1)
    with pytest.raises(ValueError, match="a number that is not finite"):
        env.step(np.array([np.nan, 0.0, 0.0], np.float32))


@pytest.mark.skipif(not os.environ.get("SWERVE_SLOW"), reason="slow: set SWERVE_SLOW=1")
def test_a_steering_policy_is_learned() -> None:
    """Cross-entropy over the gains of a steering law: beside the lane at first, on it at the end."""
    import sys
    from pathlib import Path

    sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples/python"))
    import train

    first, last = train.train(generations=8, seed=1)
    assert last > first + 5.0, (first, last)
