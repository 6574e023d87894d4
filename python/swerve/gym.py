"""Environments to learn in: a drive that an agent steps, one or many at once.

>>> import gymnasium, swerve.gym
>>> env = gymnasium.make("swerve/PersonBehindTruck-v0")
>>> observation, info = env.reset(seed=1)

The graph is the one of every drive, with the agent in the place of its controller (`level="command"`), or of its planner
(`"plan"`, or `"target"`: speed and lateral offset, from which a plan is made). A step goes on in virtual time to the next
decision. Equal seeds and actions give equal observations, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, SupportsFloat, TypeAlias

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from . import _swerve
from ._files import FileOrDict, scenarios


class Facts(NamedTuple):
    """What is true of the drive at a decision: for rewards, not for agents."""

    time_s: float
    """Simulated time, seconds."""
    s_m: float
    """Where the ego is along its route, metres."""
    d_m: float
    """How far to the left of it, metres."""
    heading_error_rad: float
    """How far it is turned to the left of the route, radians."""
    speed_mps: float
    """Its speed, m/s."""
    accel_mps2: float
    """Its acceleration along its heading, m/s²."""
    lateral_accel_mps2: float
    """Its lateral acceleration, m/s²; positive to the left."""
    target_speed_mps: float
    """How fast the scenario wants it to go, m/s."""
    collided: float
    """1 once it has touched something."""
    left_road: float
    """1 once a part of it has left the drivable ground."""
    ended: float
    """How the drive ended: 0 not yet, 1 at its goal, 2 stopped, 3 after a collision, 4 its time is over."""


assert list(Facts._fields) == _swerve.Drives.facts()

ENDINGS = (None, "goal", "stopped", "collision", "timeout")
_TIMEOUT = ENDINGS.index("timeout")

Action: TypeAlias = NDArray[np.float32]
#: A reward from the facts before and after a step, and the action between them.
Reward: TypeAlias = Callable[[Facts, Action, Facts], SupportsFloat]
Observation: TypeAlias = Any


def progress_reward(before: Facts, action: Action, after: Facts) -> float:
    """Metres along the route, less what it costs to be beside it; a collision or leaving the road costs 100."""
    reward = after.s_m - before.s_m - 0.02 * abs(after.d_m)
    if after.collided > before.collided or after.left_road > before.left_road:
        reward -= 100.0
    return reward


class _Layout:
    """How observations and actions lie in the numbers of the extension."""

    def __init__(self, drives: _swerve.Drives, observe: str | Sequence[str]) -> None:
        self.period_s = drives.period_s()
        self.fields: dict[str, list[str]] = {}
        self.slices: list[tuple[str, slice, tuple[int, ...]]] = []
        self.images: list[str] = []
        each: dict[str, spaces.Space[Any]] = {}
        begin = 0
        for name, shape, kind, fields in drives.observations():
            self.fields[name] = fields
            if fields:
                size = int(np.prod(shape))
                self.slices.append((name, slice(begin, begin + size), tuple(shape)))
                begin += size
                each[name] = spaces.Box(-np.inf, np.inf, tuple(shape), np.float32)
            else:
                self.images.append(name)
                number = np.dtype(kind)
                high: Any = np.inf if number.kind == "f" else np.iinfo(number).max
                each[name] = spaces.Box(0, high, tuple(shape), number.type)
        self.numbers = begin
        self.single = observe if isinstance(observe, str) else None
        self.observation_space = each[self.single] if self.single else spaces.Dict(each)
        low, high, names = zip(*drives.actions())
        self.action_fields = list(names)
        self.action_space = spaces.Box(np.array(low, np.float32), np.array(high, np.float32), dtype=np.float32)

    def observation(self, numbers: NDArray[np.float32], image: Callable[[str], Any]) -> Observation:
        """An observation from its numbers, `(..., numbers)`."""
        if self.single and not self.images:
            return numbers.reshape(numbers.shape[:-1] + self.slices[0][2])
        each = {
            name: numbers[..., place].reshape(numbers.shape[:-1] + shape) for name, place, shape in self.slices
        }
        each |= {name: image(name) for name in self.images}
        return each[self.single] if self.single else each


def _facts(facts: bytearray) -> NDArray[np.float64]:
    return np.frombuffer(facts, np.float64)


class DrivingEnv(gymnasium.Env[Observation, Action]):
    """A drive that an agent steps.

    `scenario`, `config`, `set` and `allow_code` are those of `swerve.run`. `level` says in whose place the agent decides: `command`
    (steering, throttle, brake, every control period), `plan` (ten points 0.3 s apart, as seen from the ego) or `target`
    (speed and lateral offset), once a frame of the obstacle sensor. `observe` names one stream, for an array, or several,
    for a dictionary of arrays; `route` is where the ego is on its route. Of lists the `rows` nearest things are observed,
    as seen from the ego. `reward` makes a number of a step.

    The drive is terminated where it ended by itself (goal, standstill, collision) and truncated where its time was over.
    `info` has the facts, and how the drive ended.
    """

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(
        self,
        scenario: FileOrDict = "person_behind_truck",
        config: FileOrDict | None = None,
        *,
        set: dict[str, Any] | None = None,
        level: str = "command",
        observe: str | Sequence[str] = ("route", "pose", "obstacles"),
        reward: Reward = progress_reward,
        rows: int = 8,
        allow_code: bool = False,
        render_mode: str | None = None,
    ) -> None:
        if render_mode is not None:
            raise ValueError("render_mode: there is none; observe a camera's stream instead")
        self.render_mode = None
        names = [observe] if isinstance(observe, str) else list(observe)
        self._drives = _swerve.Drives(
            scenario,
            level,
            names,
            config=config,
            set=set,
            rows=rows,
            allow_code=allow_code,
        )
        self._layout = _Layout(self._drives, observe)
        self._reward = reward
        self._before: Facts | None = None
        self.observation_space = self._layout.observation_space
        self.action_space = self._layout.action_space

    @property
    def period_s(self) -> float:
        """From one decision to the next, simulated seconds."""
        return self._layout.period_s

    @property
    def observation_fields(self) -> dict[str, list[str]]:
        """What the numbers of each stream are called; of an image nothing."""
        return self._layout.fields

    @property
    def action_fields(self) -> list[str]:
        """What the numbers of an action are called."""
        return self._layout.action_fields

    def _image(self, name: str) -> NDArray[Any]:
        numbers = self._drives.image(0, name)
        if numbers is None:  # Its sensor has not seen anything yet.
            space = self.observation_space
            space = space[name] if isinstance(space, spaces.Dict) else space
            return np.zeros(space.shape or (), space.dtype)
        return np.array(numbers)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begins a drive. Its seed is the one given, or else drawn from the one given last."""
        super().reset(seed=seed)
        drawn = int(self.np_random.integers(2**31)) if seed is None else seed
        numbers, facts = self._drives.reset(drawn)
        self._before = Facts._make(_facts(facts).tolist())
        observation = self._layout.observation(np.frombuffer(numbers, np.float32), self._image)
        return observation, {"facts": self._before, "seed": drawn}

    def step(self, action: Action) -> tuple[Observation, SupportsFloat, bool, bool, dict[str, Any]]:
        """Goes on to the next decision."""
        if self._before is None or self._before.ended:
            raise gymnasium.error.ResetNeeded("reset() comes before step(), and after the end of a drive")
        numbers, told = self._drives.step(np.asarray(action, np.float64).tolist())
        facts = Facts._make(_facts(told).tolist())
        reward = float(self._reward(self._before, action, facts))
        self._before = facts
        ended = int(facts.ended)
        info: dict[str, Any] = {"facts": facts}
        if ended:
            info["ended"] = ENDINGS[ended]
        observation = self._layout.observation(np.frombuffer(numbers, np.float32), self._image)
        return observation, reward, 0 < ended < _TIMEOUT, ended == _TIMEOUT, info


#: Rewards of many drives from the facts before and after a step, `(drives, facts)`, and the actions between them.
VectorReward: TypeAlias = Callable[
    [NDArray[np.float64], NDArray[np.float32], NDArray[np.float64]], NDArray[np.float64]
]


def progress_rewards(
    before: NDArray[np.float64], actions: NDArray[np.float32], after: NDArray[np.float64]
) -> NDArray[np.float64]:
    """`progress_reward` of many drives."""
    s, d = Facts._fields.index("s_m"), Facts._fields.index("d_m")
    bad = [Facts._fields.index("collided"), Facts._fields.index("left_road")]
    rewards: NDArray[np.float64] = after[:, s] - before[:, s] - 0.02 * np.abs(after[:, d])
    rewards[(after[:, bad] > before[:, bad]).any(axis=1)] -= 100.0
    return rewards


class DrivingVectorEnv(VectorEnv[Observation, NDArray[np.float32], NDArray[Any]]):
    """Many drives at once, stepped on `threads` threads without Python in between.

    The other arguments are those of `DrivingEnv`, but that rewards are made of arrays, and that images are not observed. A
    drive that is over begins anew in the next step (`AutoresetMode.NEXT_STEP`). The drives' seeds are drawn from the one
    of `reset`.
    """

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        num_envs: int = 1,
        scenario: FileOrDict = "person_behind_truck",
        config: FileOrDict | None = None,
        *,
        threads: int = 1,
        set: dict[str, Any] | None = None,
        level: str = "command",
        observe: str | Sequence[str] = ("route", "pose", "obstacles"),
        reward: VectorReward = progress_rewards,
        rows: int = 8,
        allow_code: bool = False,
    ) -> None:
        self.num_envs = num_envs
        self.render_mode = None
        self._drives = _swerve.Drives(
            scenario,
            level,
            [observe] if isinstance(observe, str) else list(observe),
            config=config,
            set=set,
            count=num_envs,
            threads=threads,
            rows=rows,
            allow_code=allow_code,
        )
        self._layout = _Layout(self._drives, observe)
        if self._layout.images:
            raise ValueError(f"observe: {', '.join(self._layout.images)} are images; vectors of drives have numbers only")
        self._reward = reward
        self._before: NDArray[np.float64] | None = None
        self.single_observation_space = self._layout.observation_space
        self.single_action_space = self._layout.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def _observation(self, numbers: bytearray) -> Observation:
        array = np.frombuffer(numbers, np.float32).reshape(self.num_envs, self._layout.numbers)
        return self._layout.observation(array, lambda name: None)

    def _told(self, facts: bytearray) -> NDArray[np.float64]:
        return _facts(facts).reshape(self.num_envs, len(Facts._fields))

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begins all drives, under seeds drawn from the one given, or under each its own."""
        one = seed if isinstance(seed, int) else None
        super().reset(seed=one)
        if isinstance(seed, list):
            drawn = [int(self.np_random.integers(2**31)) if each is None else each for each in seed]
            for index, each in enumerate(drawn):
                self._drives.reset(each, index) if index else self._begin(each)
            numbers, facts = self._drives.reset(drawn[0], 0)
        else:
            numbers, facts = self._drives.reset(int(self.np_random.integers(2**31)) if one is None else one)
        self._before = self._told(facts)
        return self._observation(numbers), {"facts": self._before}

    def _begin(self, seed: int) -> None:
        """Begins all drives, so that there is something to tell of each."""
        self._drives.reset(seed)

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[Observation, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Goes on to the next decisions."""
        if self._before is None:
            raise gymnasium.error.ResetNeeded("reset() comes before step()")
        numbers, told = self._drives.step(np.asarray(actions, np.float64).ravel().tolist())
        facts = self._told(told)
        column = Facts._fields.index("ended")
        ended, began = facts[:, column], self._before[:, column] > 0
        rewards = np.asarray(self._reward(self._before, actions, facts), np.float64)
        rewards[began] = 0.0
        self._before = facts
        terminated, truncated = (ended > 0) & (ended < _TIMEOUT), ended == _TIMEOUT
        return self._observation(numbers), rewards, terminated, truncated, {"facts": facts}


def _id(scenario: str) -> str:
    words = scenario.replace("/", "_").split("_")
    return "swerve/" + "".join(word.capitalize() for word in words) + "-v0"


def register() -> None:
    """Makes the scenarios of the package known to Gymnasium: `swerve/PersonBehindTruck-v0`, those of a folder by both names,
    `swerve/EverydayStartInJam-v0`, and so on."""
    for scenario in scenarios():
        if _id(scenario) not in gymnasium.registry:
            gymnasium.register(
                id=_id(scenario),
                entry_point="swerve.gym:DrivingEnv",
                vector_entry_point="swerve.gym:DrivingVectorEnv",
                kwargs={"scenario": scenario},
            )


register()
