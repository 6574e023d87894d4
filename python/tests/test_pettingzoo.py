"""Several egos with an agent each: PettingZoo's own check, equal drives, and what ends an agent's part."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

pytest.importorskip("gymnasium")
pytest.importorskip("pettingzoo")
from pettingzoo.test import parallel_api_test  # noqa: E402

import swerve.gym  # noqa: E402
from swerve.pettingzoo import parallel_env  # noqa: E402

#: Two egos behind each other on a straight road; the first one is 30 m from its goal.
SCENARIO: dict[str, Any] = {
    "name": "two",
    "road": {"segments": [{"length_m": 200.0}], "left_m": 6.0},
    "ego": {
        "leader": {"s_m": 60.0, "target_speed_mps": 8.0, "end_m": 90.0},
        "follower": {"s_m": 10.0, "target_speed_mps": 8.0, "end_m": 150.0},
    },
    "end": {"timeout_s": 12.0},
}


def drive(env: Any, action: Any, seed: int = 3) -> list[Any]:
    """All that a drive gives, with actions that depend on the agent and the step."""
    steps = [env.reset(seed=seed)]
    while env.agents:
        steps.append(env.step({name: action(name, len(steps)) for name in env.agents}))
    return steps


@pytest.mark.parametrize("level", ["command", "plan", "target"])
def test_the_check_of_pettingzoo_passes(level: str) -> None:
    for scenario in (SCENARIO, "lane"):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            parallel_api_test(parallel_env(scenario, level=level), num_cycles=60)


def test_equal_seeds_and_actions_give_equal_drives() -> None:
    def action(name: str, k: int) -> Any:
        return np.array([6.0 + (k % 5) + (name == "leader"), 0.3 if k % 20 < 10 else -0.3], np.float32)

    env = parallel_env(SCENARIO, level="target", set={"sensing.pose.position_noise_m": 0.1})
    one, two = drive(env, action), drive(env, action)
    assert len(one) == len(two) > 20
    np.testing.assert_equal(one, two)
    other = drive(env, action, seed=4)
    assert any((a[0]["leader"]["pose"] != b[0]["leader"]["pose"]).any() for a, b in zip(one, other))


def test_agents_end_one_by_one_and_the_ended_ego_stops() -> None:
    env = parallel_env(SCENARIO, level="target")
    steps = drive(env, lambda name, _: np.array([8.0 if name == "leader" else 2.0, 0.0], np.float32))
    ends = {name: k for k, step in enumerate(steps[1:], 1) for name in step[4] if "ended" in step[4][name]}
    assert ends["leader"] < ends["follower"] == len(steps) - 1
    leader, follower = steps[ends["leader"]], steps[ends["follower"]]
    assert (leader[2], leader[3]) == ({"leader": True, "follower": False}, {"leader": False, "follower": False})
    assert leader[4]["leader"]["ended"] == "goal"
    assert set(steps[ends["leader"] + 1][0]) == {"follower"}
    # The time was over for the second one, which sees the first one stand ahead.
    assert (follower[2], follower[3], follower[4]["follower"]["ended"]) == ({"follower": False}, {"follower": True}, "timeout")
    present, _, ahead_m, *_, forward_mps, _, _, _ = follower[0]["follower"]["obstacles"][0]
    assert present == 1.0 and ahead_m > 20.0 and abs(forward_mps) < 0.05


def test_an_agent_observes_from_its_own_ego() -> None:
    env = parallel_env(SCENARIO, level="command")
    observations, infos = env.reset(seed=1)
    x_m = [observations[name]["pose"][env.observation_fields["pose"].index("x_m")] for name in ("leader", "follower")]
    # The seed moves both a little.
    assert abs(x_m[0] - x_m[1] - 50.0) < 3.0
    assert infos["leader"]["facts"].s_m - infos["follower"]["facts"].s_m == pytest.approx(x_m[0] - x_m[1], abs=0.01)
    # Each sees the other, once its obstacle sensor has measured.
    ahead = env.observation_fields["obstacles"].index("forward_m")
    for _ in range(12):
        observations, *_ = env.step({name: np.zeros(3, np.float32) for name in env.agents})
    assert observations["follower"]["obstacles"][0, ahead] > 40.0
    assert observations["leader"]["obstacles"][0, ahead] < -40.0


def test_one_ego_drives_as_in_gymnasium() -> None:
    single, several = swerve.gym.DrivingEnv("lane"), parallel_env("lane")
    (a, _), (b, _) = single.reset(seed=5), several.reset(seed=5)
    (name,) = several.agents
    for k in range(50):
        np.testing.assert_equal(a, b[name])
        action = np.array([0.01, 0.2 + 0.01 * (k % 3), 0.0], np.float32)
        a, reward, *_ = single.step(action)
        b, rewards, *_ = several.step({name: action})
        assert reward == rewards[name]


def test_wrong_arguments_are_named() -> None:
    env = parallel_env(SCENARIO)
    with pytest.raises(Exception, match="reset"):
        env.step({})
    env.reset(seed=1)
    with pytest.raises(ValueError, match="expected those of follower, leader, found leader"):
        env.step({"leader": np.zeros(3, np.float32)})
    with pytest.raises(ValueError, match=r"actions\['follower'\]: expected an array of the shape \(3,\), found \(2,\)"):
        env.step({"leader": np.zeros(3, np.float32), "follower": np.zeros(2, np.float32)})
    with pytest.raises(Exception, match="not finite"):
        env.step({"leader": np.zeros(3, np.float32), "follower": np.full(3, np.nan, np.float32)})
    with pytest.raises(ValueError, match="expected one of follower, leader, found 'nobody'"):
        env.action_space("nobody")
    with pytest.raises(ValueError, match="swerve.pettingzoo has an agent for each"):
        swerve.gym.DrivingEnv(SCENARIO)
