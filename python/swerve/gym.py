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
from ._files import FileOrDict, checked_file, checked_threads, scenarios
from ._picture import picture
from .varied import varied


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
    """Metres along the route, less what it costs to be beside it; two for each metre driven in excess of the target speed. A
    collision or leaving the road costs 100."""
    excess_m = max(0.0, after.speed_mps - after.target_speed_mps) * (after.time_s - before.time_s)
    reward = after.s_m - before.s_m - 0.02 * abs(after.d_m) - 2.0 * excess_m
    if after.collided > before.collided or after.left_road > before.left_road:
        reward -= 100.0
    return reward


#: Sizes by which normalised observations are divided, by the unit at the end of a name.
_SCALES = {
    "m": 100.0,
    "mps": 30.0,
    "mps2": 10.0,
    "rad": float(np.pi),
    "radps": 1.0,
    "1pm": 0.1,
    "deg": 180.0,
    "dbsm": 40.0,
    "kind": 10.0,
}


def _scale(field: str) -> float:
    """Size of a number with this name, of which some end with a place: `curvature_1pm.5.0m`."""
    return _SCALES.get(field.split(".")[0].rsplit("_", 1)[-1], 1.0)


class _Layout:
    """How observations and actions lie in the numbers of the extension."""

    def __init__(
        self, drives: _swerve.Drives | _swerve.Egos, observe: str | Sequence[str], normalize: bool
    ) -> None:
        self.period_s = drives.period_s()
        self.fields: dict[str, list[str]] = {}
        self.slices: list[tuple[str, slice, tuple[int, ...]]] = []
        self.images: list[str] = []
        each: dict[str, spaces.Space[Any]] = {}
        begin, scales, most = 0, [], 1.0 if normalize else np.inf
        for name, shape, kind, fields in drives.observations():
            self.fields[name] = fields
            if fields:
                size = int(np.prod(shape))
                self.slices.append((name, slice(begin, begin + size), tuple(shape)))
                begin += size
                scales += [_scale(field) for field in fields] * (size // len(fields))
                each[name] = spaces.Box(-most, most, tuple(shape), np.float32)
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
        self._low, self._high = np.array(low, np.float64), np.array(high, np.float64)
        self._scales = np.array(scales, np.float32) if normalize else None
        bounds = (-np.ones(len(low), np.float32), np.ones(len(low), np.float32))
        bounds = bounds if normalize else (np.array(low, np.float32), np.array(high, np.float32))
        self.action_space = spaces.Box(*bounds, dtype=np.float32)

    def action(self, action: NDArray[Any]) -> list[float]:
        """The numbers of the extension for actions, `(..., numbers)`."""
        numbers = np.asarray(action, np.float64)
        if self._scales is not None:
            numbers = self._low + 0.5 * (numbers + 1.0) * (self._high - self._low)
        flat: list[float] = numbers.ravel().tolist()
        return flat

    def observation(self, numbers: NDArray[np.float32], image: Callable[[str], Any]) -> Observation:
        """An observation from its numbers, `(..., numbers)`."""
        if self._scales is not None:
            numbers = np.clip(numbers / self._scales, -1.0, 1.0).astype(np.float32)
        if self.single and not self.images:
            return numbers.reshape(numbers.shape[:-1] + self.slices[0][2])
        each = {
            name: numbers[..., place].reshape(numbers.shape[:-1] + shape) for name, place, shape in self.slices
        }
        each |= {name: image(name) for name in self.images}
        if self.single:
            return each[self.single]
        assert isinstance(self.observation_space, spaces.Dict)
        return {name: each[name] for name in self.observation_space.spaces}


def _refuse(options: dict[str, Any] | None) -> None:
    if options:
        raise ValueError(f"reset: unknown options {', '.join(sorted(options))}: expected none")


def _blank(space: spaces.Space[Any]) -> NDArray[Any]:
    """The image of a sensor that has not seen anything yet."""
    return np.zeros(space.shape or (), space.dtype)


def _facts(facts: bytearray) -> NDArray[np.float64]:
    return np.frombuffer(facts, np.float64)


#: A scenario, or a function from the seed of a drive to the scenario's content.
Scenarios: TypeAlias = FileOrDict | Callable[[int], dict[str, Any]]


class DrivingEnv(gymnasium.Env[Observation, Action]):
    """A drive that an agent steps.

    `scenario`, `config`, `set` and `allow_code` are those of `swerve.run`; `scenario` may also be a function from a seed to a
    scenario, such as `swerve.varied`. `level` says in whose place the agent decides: `command`
    (steering, throttle, brake, every control period), `plan` (ten points 0.3 s apart, as seen from the ego) or `target`
    (speed and lateral offset), once a frame of the obstacle sensor. `observe` names one stream, for an array, or several,
    for a dictionary of arrays; `route` is where the ego is on its route. Of lists the `rows` nearest things are observed,
    as seen from the ego. `reward` makes a number of a step. With `normalize`, numbers of observations and actions are
    within -1 and 1: observations are divided by fixed sizes (100 m, 30 m/s, ...) and clipped. `render_mode="rgb_array"` draws the
    drive from above.

    The drive is terminated where it ended by itself (goal, standstill, collision) and truncated where its time was over.
    `info` has the facts, and how the drive ended. A copy (`copy.deepcopy`, `pickle`) is at the same place of the same
    drive: it takes the same steps again.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 20}

    def __init__(
        self,
        scenario: Scenarios = "person_behind_truck",
        config: FileOrDict | None = None,
        *,
        set: dict[str, Any] | None = None,
        level: str = "command",
        observe: str | Sequence[str] = ("route", "pose", "obstacles"),
        reward: Reward = progress_reward,
        rows: int = 8,
        normalize: bool = False,
        allow_code: bool = False,
        render_mode: str | None = None,
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode: expected rgb_array, found {render_mode!r}")
        self.render_mode = render_mode
        names = [observe] if isinstance(observe, str) else list(observe)
        own: dict[str, Any] = {"config": config, "set": set, "rows": rows, "allow_code": allow_code}
        about: dict[str, Any] = {"level": level, "observe": observe, "reward": reward, "normalize": normalize}
        self._arguments = (scenario, {**own, **about, "render_mode": render_mode})
        self._make: Callable[[FileOrDict], _swerve.Drives] = lambda content: _swerve.Drives(content, level, names, **own)
        self._scenario = scenario
        if not callable(scenario):
            checked_file("scenario", scenario)
        self._drives = self._make(scenario(0) if callable(scenario) else scenario)
        self._layout = _Layout(self._drives, observe, normalize)
        self._reward = reward
        self._before: Facts | None = None
        self._drawn = 0
        self._taken: list[list[float]] = []
        self.observation_space = self._layout.observation_space
        self.action_space = self._layout.action_space
        self.metadata = {**self.metadata, "render_fps": max(1, round(1.0 / self._layout.period_s))}

    def __getstate__(self) -> dict[str, Any]:
        begun = None if self._before is None else (self._drawn, self._taken)
        random = (self._np_random, self._np_random_seed)
        return {"arguments": self._arguments, "begun": begun, "random": random, "spec": self.spec}

    def __setstate__(self, state: dict[str, Any]) -> None:
        scenario, keywords = state["arguments"]
        self.__init__(scenario, **keywords)  # type: ignore[misc]
        if state["begun"] is not None:
            drawn, taken = state["begun"]
            self._begin(drawn)
            for numbers in taken:
                self._go_on(list(numbers))
        self._np_random, self._np_random_seed = state["random"]
        self.spec = state["spec"]

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
        if numbers is None:
            space = self.observation_space
            return _blank(space[name] if isinstance(space, spaces.Dict) else space)
        return np.array(numbers)

    def _begin(self, seed: int) -> Observation:
        if callable(self._scenario):
            self._drives = self._make(self._scenario(seed))
        numbers, facts = self._drives.reset(seed)
        self._before, self._drawn, self._taken = Facts._make(_facts(facts).tolist()), seed, []
        return self._layout.observation(np.frombuffer(numbers, np.float32), self._image)

    def _go_on(self, action: list[float]) -> Observation:
        numbers, texts = self._drives.step(action)
        self._taken.append(action)
        self._before = Facts._make(_facts(texts).tolist())
        return self._layout.observation(np.frombuffer(numbers, np.float32), self._image)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begins a drive. Its seed is the one given, or else drawn from the one given last. There are no options."""
        _refuse(options)
        super().reset(seed=seed)
        drawn = int(self.np_random.integers(2**31)) if seed is None else seed
        observation = self._begin(drawn)
        return observation, {"facts": self._before, "seed": drawn}

    def step(self, action: Action) -> tuple[Observation, SupportsFloat, bool, bool, dict[str, Any]]:
        """Goes on to the next decision."""
        before = self._before
        if before is None or before.ended:
            raise gymnasium.error.ResetNeeded("reset() comes before step(), and after the end of a drive")
        observation = self._go_on(self._layout.action(action))
        facts = self._before
        assert facts is not None
        reward = float(self._reward(before, action, facts))
        ended = int(facts.ended)
        info: dict[str, Any] = {"facts": facts}
        if ended:
            info["ended"] = ENDINGS[ended]
        return observation, reward, 0 < ended < _TIMEOUT, ended == _TIMEOUT, info

    def render(self) -> Any:
        """The drive from above, an array of rows, columns and three colours; `None` without `render_mode`."""
        if self.render_mode is None:
            return None
        if self._before is None:
            raise gymnasium.error.ResetNeeded("reset() comes before render()")
        return picture(*self._drives.scene(0))


#: Rewards of many drives from the facts before and after a step, `(drives, facts)`, and the actions between them.
VectorReward: TypeAlias = Callable[
    [NDArray[np.float64], NDArray[np.float32], NDArray[np.float64]], NDArray[np.float64]
]


def progress_rewards(
    before: NDArray[np.float64], actions: NDArray[np.float32], after: NDArray[np.float64]
) -> NDArray[np.float64]:
    """`progress_reward` of many drives."""
    time, s, d, speed, target, *bad = (
        Facts._fields.index(name)
        for name in ("time_s", "s_m", "d_m", "speed_mps", "target_speed_mps", "collided", "left_road")
    )
    excess_m = np.maximum(0.0, after[:, speed] - after[:, target]) * (after[:, time] - before[:, time])
    rewards: NDArray[np.float64] = after[:, s] - before[:, s] - 0.02 * np.abs(after[:, d]) - 2.0 * excess_m
    rewards[(after[:, bad] > before[:, bad]).any(axis=1)] -= 100.0
    return rewards


_AUTORESET = {"next_step": AutoresetMode.NEXT_STEP, "same_step": AutoresetMode.SAME_STEP}


class DrivingVectorEnv(VectorEnv[Observation, NDArray[np.float32], NDArray[Any]]):
    """Many drives at once, stepped on `threads` threads without Python in between.

    The other arguments are those of `DrivingEnv`, but that rewards are made of arrays and that all drives have one scenario. A
    drive that is over begins anew in the next step (`AutoresetMode.NEXT_STEP`), or in the same one with
    `autoreset="same_step"`; then its last observation is in the infos, `final_obs`. The drives' seeds are drawn from the one
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
        normalize: bool = False,
        autoreset: str = "next_step",
        allow_code: bool = False,
    ) -> None:
        checked_file("scenario", scenario)
        if autoreset not in _AUTORESET:
            raise ValueError(f"autoreset: expected one of {', '.join(_AUTORESET)}, found {autoreset!r}")
        self.metadata = {**self.metadata, "autoreset_mode": _AUTORESET[autoreset]}
        self.num_envs = num_envs
        self.render_mode = None
        self._drives = _swerve.Drives(
            scenario,
            level,
            [observe] if isinstance(observe, str) else list(observe),
            config=config,
            set=set,
            count=num_envs,
            threads=checked_threads(threads),
            rows=rows,
            allow_code=allow_code,
        )
        self._layout = _Layout(self._drives, observe, normalize)
        self._reward = reward
        self._before: NDArray[np.float64] | None = None
        self.single_observation_space = self._layout.observation_space
        self.single_action_space = self._layout.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def _observation(self, numbers: bytearray) -> Observation:
        array = np.frombuffer(numbers, np.float32).reshape(self.num_envs, self._layout.numbers)
        return self._layout.observation(array, self._images)

    def _images(self, name: str) -> NDArray[Any]:
        space = self.single_observation_space
        blank = _blank(space[name] if isinstance(space, spaces.Dict) else space)
        each = (self._drives.image(index, name) for index in range(self.num_envs))
        return np.stack([blank if numbers is None else np.asarray(numbers) for numbers in each])

    def _told(self, facts: bytearray) -> NDArray[np.float64]:
        return _facts(facts).reshape(self.num_envs, len(Facts._fields))

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begins all drives, under seeds drawn from the one given, or under each its own."""
        _refuse(options)
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
        numbers, texts = self._drives.step(self._layout.action(actions))
        facts = self._told(texts)
        column = Facts._fields.index("ended")
        ended, began = facts[:, column], self._before[:, column] > 0
        rewards = np.asarray(self._reward(self._before, actions, facts), np.float64)
        rewards[began] = 0.0
        self._before = facts
        terminated, truncated = (ended > 0) & (ended < _TIMEOUT), ended == _TIMEOUT
        info: dict[str, Any] = {"facts": facts}
        if ended.any():
            # As Gymnasium has entries that some drives have: with a mask under the name with an underscore.
            info |= {"ended": np.array([ENDINGS[int(code)] for code in ended], object), "_ended": ended > 0}
        observation = self._observation(numbers)
        if ended.any() and self.metadata["autoreset_mode"] == AutoresetMode.SAME_STEP:
            observation = self._restart(observation, info)
        return observation, rewards, terminated, truncated, info

    def _restart(self, observation: Observation, info: dict[str, Any]) -> Observation:
        """Begins the drives that are over anew; their last observations are in `info` from then on."""
        last = np.full(self.num_envs, None, object)
        for index in np.flatnonzero(info["_ended"]).tolist():
            one = {name: values[index] for name, values in observation.items()} if isinstance(observation, dict) else None
            last[index] = observation[index] if one is None else one
            numbers, facts = self._drives.reset(int(self.np_random.integers(2**31)), index)
        info |= {"final_obs": last, "_final_obs": info["_ended"]}
        self._before = self._told(facts)
        return self._observation(numbers)


def _id(scenario: str) -> str:
    words = scenario.replace("/", "_").split("_")
    return "swerve/" + "".join(word.capitalize() for word in words) + "-v0"


def register() -> None:
    """Makes the scenarios of the package known to Gymnasium: `swerve/PersonBehindTruck-v0`, those of a folder by both names,
    `swerve/EverydayStartInJam-v0`, and so on; and `swerve/Varied-v0`, another scenario for each seed."""
    if "swerve/Varied-v0" not in gymnasium.registry:
        gymnasium.register(
            id="swerve/Varied-v0", entry_point="swerve.gym:DrivingEnv", kwargs={"scenario": varied}
        )
    for scenario in scenarios():
        if _id(scenario) not in gymnasium.registry:
            gymnasium.register(
                id=_id(scenario),
                entry_point="swerve.gym:DrivingEnv",
                vector_entry_point="swerve.gym:DrivingVectorEnv",
                kwargs={"scenario": scenario},
            )


register()
