"""Environments: Gymnasium's own checks, bit-equal drives, and an agent that learns."""

from __future__ import annotations

import copy
import os
import pickle
import subprocess
import sys
import types
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


def test_normalised_numbers_are_within_their_spaces() -> None:
    env = gymnasium.make("swerve/PersonBehindTruck-v0", level="target", observe=("route", "tracker", "pose"), normalize=True)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        check_env(env.unwrapped, skip_render_check=True)
    plain = swerve.gym.DrivingEnv("person_behind_truck", level="target", observe=("route", "tracker", "pose"))
    one, _ = env.reset(seed=4)
    other, _ = plain.reset(seed=4)
    speed = plain.observation_fields["pose"].index("speed_mps")
    assert one["pose"][speed] == np.float32(other["pose"][speed] / np.float32(30.0)) != 0.0
    low, high = plain.action_space.low, plain.action_space.high
    for share in (0.25, 0.5):
        action = np.array([share, -share], np.float32)
        one, *_ = env.step(action)
        other, *_ = plain.step(low + 0.5 * (action + 1.0) * (high - low))
        assert abs(one["pose"][speed] - other["pose"][speed] / 30.0) < 1e-6
        assert env.observation_space.contains(one)


def test_observations_have_the_order_of_the_space() -> None:
    env = swerve.gym.DrivingEnv("lane", observe=("route", "pose", "obstacles"))
    observation, _ = env.reset(seed=1)
    assert list(observation) == list(env.observation_space.spaces)


def test_a_drive_is_drawn_from_above() -> None:
    env = gymnasium.make("swerve/PersonBehindTruck-v0", level="target", observe="pose", render_mode="rgb_array")
    env.reset(seed=1)
    first = env.render()
    assert first.shape == (240, 640, 3) and first.dtype == np.uint8
    ego = (first == (33, 102, 172)).all(axis=-1)
    rows, columns = np.nonzero(ego)
    # A car of about 5 m by 2 m, at five pixels a metre, a quarter of the width from the left.
    assert 18 < np.ptp(columns) < 32 and 7 < np.ptp(rows) < 14 and abs(columns.mean() - 160) < 3 and abs(rows.mean() - 120) < 3
    for _ in range(100):
        env.step(np.array([20.0, 0.0], np.float32))
    assert (env.render() != first).any() and ((env.render() == (250, 214, 120)).all(axis=-1).sum() > 50)
    with pytest.raises(gymnasium.error.ResetNeeded):
        swerve.gym.DrivingEnv("lane", render_mode="rgb_array").render()
    assert swerve.gym.DrivingEnv("lane").render() is None


def test_copies_are_at_the_same_place_of_the_same_drive() -> None:
    env = swerve.gym.DrivingEnv("person_crossing", observe="pose", normalize=True)
    env.reset(seed=3)
    for _ in range(40):
        env.step(np.array([0.0, -0.5, -1.0], np.float32))
    copies = [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]
    for _ in range(20):
        action = np.array([0.1, 0.0, -1.0], np.float32)
        observation, reward, *_ = env.step(action)
        for other in copies:
            again, same, *_ = other.step(action)
            assert (observation == again).all() and reward == same
    seeds = {each.reset()[1]["seed"] for each in [env, *copies]}
    assert len(seeds) == 1, "and so are their next drives"
    assert pickle.loads(pickle.dumps(swerve.gym.DrivingEnv("lane"))).reset(seed=1)


def test_options_of_reset_are_refused() -> None:
    env = swerve.gym.DrivingEnv("lane")
    env.reset(seed=1, options={})
    with pytest.raises(ValueError, match="reset: unknown options speed: expected none"):
        env.reset(options={"speed": 3})
    with pytest.raises(ValueError, match="reset: unknown options"):
        swerve.gym.DrivingVectorEnv(2, "lane").reset(options={"speed": 3})


def test_vectors_of_drives_observe_images_and_lidars() -> None:
    config = {**CAMERA, "lidar": {"roof": {}}, "log": {"sensors": ["front", "roof"]}}
    observe = ("front.rgb", "roof.points", "obstacles")
    vector = swerve.gym.DrivingVectorEnv(2, "person_behind_truck", config, observe=observe, level="target")
    assert vector.observation_space["front.rgb"].shape == (2, 16, 32, 3)
    assert vector.observation_space["roof.points"].shape == (2, 72)
    observation, _ = vector.reset(seed=[1, 2])
    for _ in range(40):
        observation, *_ = vector.step(np.full((2, 2), (20.0, 0.0), np.float32))
    assert vector.observation_space.contains(observation)
    assert observation["front.rgb"].any() and (observation["front.rgb"][0] != observation["front.rgb"][1]).any()
    ranges = observation["roof.points"]
    for seen, things in zip(ranges, observation["obstacles"]):
        present, _, forward_m, left_m, *_ = things[0]
        assert present
        # From the lidar, which is above the middle of the car; to the near side of the truck.
        bearing = np.degrees(np.arctan2(left_m, forward_m - 1.4)) % 360.0
        assert abs(seen[int(bearing // 5)] - np.hypot(forward_m - 1.4, left_m)) < 4.0, (seen, things[0])
    single = swerve.gym.DrivingEnv("person_behind_truck", config, observe="roof.points", level="target")
    alone, _ = single.reset(seed=1)
    for _ in range(40):
        alone, *_ = single.step(np.array([20.0, 0.0], np.float32))
    assert (alone == ranges[0]).all()


def test_ends_are_in_the_infos_of_vectors() -> None:
    vector = swerve.gym.DrivingVectorEnv(2, "person_behind_truck", level="target", observe="pose")
    vector.reset(seed=1)
    for _ in range(600):
        *_, terminated, truncated, info = vector.step(np.array([[20.0, 0.0], [2.0, 0.0]], np.float32))
        if terminated.any():
            break
    assert info["_ended"].tolist() == terminated.tolist() == [True, False]
    assert info["ended"].tolist() == ["collision", None]


def test_scenarios_differ_by_seed() -> None:
    """Roads, speeds and road users, so that one driver who does not look ends in more than one way."""
    assert swerve.varied(5) == swerve.varied(5) != swerve.varied(6)
    env = gymnasium.make("swerve/Varied-v0", level="target", observe=("route", "obstacles"))
    endings = {}
    for seed in range(12):
        env.reset(seed=seed)
        target = env.unwrapped._before.target_speed_mps
        terminated = truncated = False
        while not (terminated or truncated):
            *_, terminated, truncated, info = env.step(np.array([target, 0.0], np.float32))
        endings[seed] = (info["ended"], round(info["facts"].time_s, 1))
    assert {"goal", "collision"} <= {ended for ended, _ in endings.values()}, endings
    assert len(set(endings.values())) > 9, endings
    observation, _ = env.reset(seed=3)
    other, _ = gymnasium.make("swerve/Varied-v0", level="target", observe=("route", "obstacles")).reset(seed=3)
    assert all((observation[name] == other[name]).all() for name in observation)


def test_the_default_reward_knows_the_speed_limit() -> None:
    facts = swerve.gym.Facts(0.0, 0.0, 0.0, 0.0, 20.0, 0.0, 0.0, 20.0, 0.0, 0.0, 0.0)
    action = np.zeros(2, np.float32)

    def after(speed_mps: float) -> float:
        then = facts._replace(time_s=1.0, s_m=speed_mps, speed_mps=speed_mps)
        many = swerve.gym.progress_rewards(np.array([facts]), action[None], np.array([then]))
        reward = swerve.gym.progress_reward(facts, action, then)
        assert many.tolist() == [reward]
        return reward

    assert after(15.0) < after(20.0) and after(24.6) < after(21.0) < after(20.0)


def test_drives_begin_anew_in_the_same_step() -> None:
    vector = swerve.gym.DrivingVectorEnv(
        2, "person_behind_truck", level="target", observe=("pose", "route"), autoreset="same_step"
    )
    assert vector.metadata["autoreset_mode"] == gymnasium.vector.AutoresetMode.SAME_STEP
    first, _ = vector.reset(seed=1)
    for _ in range(600):
        observation, _, terminated, _, info = vector.step(np.array([[20.0, 0.0], [2.0, 0.0]], np.float32))
        if terminated.any():
            break
    assert terminated.tolist() == info["_final_obs"].tolist() == [True, False]
    assert info["final_obs"][1] is None and info["final_obs"][0]["pose"][0] > 80.0
    assert observation["pose"][0][0] < 3.0 < observation["pose"][1][0]
    _, reward, terminated, *_ = vector.step(np.array([[20.0, 0.0], [2.0, 0.0]], np.float32))
    assert reward[0] > 0.5 and not terminated.any()
    with pytest.raises(ValueError, match="autoreset: expected one of next_step, same_step, found 'never'"):
        swerve.gym.DrivingVectorEnv(2, "lane", autoreset="never")


def test_adapter_of_stable_baselines_gives_last_observations(monkeypatch: pytest.MonkeyPatch) -> None:
    """Against a stand-in for the base class: the interface as Stable-Baselines3 2 documents it."""

    class Base:
        def __init__(self, num_envs: int, observation_space: Any, action_space: Any) -> None:
            self.num_envs, self.observation_space, self.action_space = num_envs, observation_space, action_space

        def step(self, actions: Any) -> Any:
            self.step_async(actions)  # type: ignore[attr-defined]
            return self.step_wait()  # type: ignore[attr-defined]

    base = types.ModuleType("stable_baselines3.common.vec_env.base_vec_env")
    base.VecEnv = Base  # type: ignore[attr-defined]
    for name in ("stable_baselines3", "stable_baselines3.common", "stable_baselines3.common.vec_env"):
        monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    monkeypatch.setitem(sys.modules, base.__name__, base)
    monkeypatch.delitem(sys.modules, "swerve.sb3", raising=False)
    from swerve.sb3 import DrivingVecEnv

    env: Any = DrivingVecEnv(2, "person_behind_truck", level="target", observe="pose", seed=4)
    first = env.reset()
    assert env.observation_space.contains(first[0]) and env.action_space.high.tolist() == [1.0, 1.0]
    fast = 2.0 * 20.0 / 40.0 - 1.0
    for _ in range(600):
        observation, rewards, dones, infos = env.step(np.array([[fast, 0.0], [-1.0, 0.0]], np.float32))
        if dones.any():
            break
    assert dones.tolist() == [True, False] and rewards.dtype == np.float32
    assert infos[0]["ended"] == "collision" and not infos[0]["TimeLimit.truncated"] and "ended" not in infos[1]
    assert infos[0]["terminal_observation"][0] > 0.8 > 0.1 > observation[0][0]
    assert env.env_is_wrapped(Base) == [False, False] and env.get_attr("render_mode", 0) == [None]
    env.seed(4)
    assert (env.reset() == first).all()


@pytest.mark.skipif(not os.environ.get("SWERVE_SLOW"), reason="slow: set SWERVE_SLOW=1")
def test_ppo_learns_to_pass_the_person() -> None:
    """Of the drives with exploration, hardly any comes to its goal at first, and a third of them after twenty iterations."""
    from pathlib import Path

    sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples/python"))
    import ppo

    _, goals = ppo.train(22, 1)
    first, last = (tuple(map(sum, zip(*part))) for part in (goals[:5], goals[17:]))
    assert first[0] < 0.1 * first[1] and last[0] > 0.25 * last[1], goals


@pytest.mark.skipif(not os.environ.get("SWERVE_SLOW"), reason="slow: set SWERVE_SLOW=1")
def test_ppo_reaches_the_goal_within_the_speed_limit() -> None:
    """On roads that were not trained on, where random actions and constant ones do not come to the goal."""
    from pathlib import Path

    sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples/python"))
    import ppo_lane

    policies = ppo_lane.policies(ppo_lane.train(60, 1))
    results = {name: ppo_lane.evaluate(policy, range(20)) for name, policy in policies.items()}
    assert all(ended == "goal" and excess_mps <= 0.1 for ended, excess_mps, _ in results.pop("trained"))
    assert len(results) == 2 and all(ended != "goal" for each in results.values() for ended, *_ in each), results
