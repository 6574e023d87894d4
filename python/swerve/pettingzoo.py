"""Several egos, each driven by an agent, as environments of PettingZoo (`pip install pettingzoo`).

>>> from swerve.pettingzoo import parallel_env
>>> env = parallel_env("maps/two_egos", level="target")
>>> observations, infos = env.reset(seed=1)
>>> actions = {name: env.action_space(name).sample() for name in env.agents}
>>> observations, rewards, terminations, truncations, infos = env.step(actions)

The agents have the names of the egos in the scenario (`[ego.NAME]`). They are asked at the same instants: the observations of all
egos come before the first decision. Equal seeds and actions give equal observations, bit for bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from . import _swerve
from ._files import FileOrDict, checked_file
from ._picture import picture
from .gym import _TIMEOUT, ENDINGS, Action, Facts, Observation, Reward, _blank, _facts, _Layout, progress_reward


class DrivingParallelEnv(ParallelEnv):
    """A drive of several egos, which agents step together.

    The arguments are those of `swerve.gym.DrivingEnv`, but that `scenario` is a file or content with one ego or more; `reward`
    makes a number of each agent's own facts. All agents have the same spaces.

    An agent is terminated where the drive ended for its ego (goal, standstill, collision) and truncated where the time was
    over; it is not among `agents` from then on. Its ego brakes to a standstill, and the drive goes on until it has ended for
    all. The `infos` have the facts, and how the drive ended.
    """

    metadata: dict[str, Any] = {"name": "swerve", "render_modes": ["rgb_array"], "render_fps": 20}

    def __init__(
        self,
        scenario: FileOrDict = "maps/two_egos",
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
        checked_file("scenario", scenario)
        names = [observe] if isinstance(observe, str) else list(observe)
        own: dict[str, Any] = {"config": config, "set": set, "rows": rows, "allow_code": allow_code}
        self.render_mode = render_mode
        self._egos = _swerve.Egos(scenario, level, names, **own)
        self._layout = _Layout(self._egos, observe, normalize)
        self._reward = reward
        self._before: dict[str, Facts] = {}
        self._random = np.random.default_rng()
        self.possible_agents: list[str] = self._egos.names()
        self.agents: list[str] = []
        self.metadata = {**self.metadata, "render_fps": max(1, round(1.0 / self._layout.period_s))}

    @property
    def period_s(self) -> float:
        """From one decision to the next, simulated seconds."""
        return self._layout.period_s

    @property
    def observation_fields(self) -> dict[str, list[str]]:
        """Names of the numbers of each stream; of an image none."""
        return self._layout.fields

    @property
    def action_fields(self) -> list[str]:
        """Names of the numbers of an action."""
        return self._layout.action_fields

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Space of an agent's observations."""
        self._place(agent)
        return self._layout.observation_space

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Space of an agent's actions."""
        self._place(agent)
        return self._layout.action_space

    def _place(self, agent: str) -> int:
        if agent not in self.possible_agents:
            raise ValueError(f"agent: expected one of {', '.join(self.possible_agents)}, found {agent!r}")
        return self.possible_agents.index(agent)

    def _unpacked(self, state: tuple[bytearray, bytearray]) -> tuple[dict[str, Observation], dict[str, Facts]]:
        """Observations and facts of all egos."""
        numbers = np.frombuffer(state[0], np.float32).reshape(len(self.possible_agents), self._layout.numbers)
        facts = _facts(state[1]).reshape(len(self.possible_agents), len(Facts._fields))
        observations = {}
        for place, agent in enumerate(self.possible_agents):
            observations[agent] = self._layout.observation(numbers[place], partial(self._image, place))
        return observations, {name: Facts._make(row.tolist()) for name, row in zip(self.possible_agents, facts)}

    def _image(self, place: int, name: str) -> NDArray[Any]:
        numbers = self._egos.image(place, name)
        if numbers is None:
            space = self._layout.observation_space
            return _blank(space[name] if isinstance(space, spaces.Dict) else space)
        return np.array(numbers)

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Begins a drive. Its seed is the one given, or else drawn from the one given last. `options` are ignored."""
        if seed is not None:
            self._random = np.random.default_rng(seed)
        drawn = int(self._random.integers(2**31)) if seed is None else seed
        observations, self._before = self._unpacked(self._egos.reset(drawn))
        self.agents = list(self.possible_agents)
        return observations, {name: {"facts": facts, "seed": drawn} for name, facts in self._before.items()}

    def step(
        self, actions: dict[str, Action]
    ) -> tuple[
        dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]
    ]:
        """Goes on to the next decision, with an action of each of `agents`."""
        if not self.agents:
            raise ResetNeeded("reset() comes before step(), and after the end of a drive")
        if set(actions) != set(self.agents):
            raise ValueError(f"actions: expected those of {', '.join(self.agents)}, found {', '.join(actions) or 'none'}")
        # The extension ignores the numbers of egos whose drive has ended.
        idle = np.zeros(self._layout.action_space.shape or (), np.float32)
        each = [np.asarray(actions.get(name, idle), np.float32) for name in self.possible_agents]
        expected = (len(self._layout.action_fields),)
        wrong = next((name for name, one in zip(self.possible_agents, each) if one.shape != expected), None)
        if wrong is not None:
            found = each[self._place(wrong)].shape
            raise ValueError(f"actions[{wrong!r}]: expected an array of the shape {expected}, found {found}")
        observations, facts = self._unpacked(self._egos.step(self._layout.action(np.stack(each))))
        before, self._before, live = self._before, facts, self.agents
        rewards, infos, over = {}, {}, {}
        for name in live:
            rewards[name] = float(self._reward(before[name], actions[name], facts[name]))
            over[name] = int(facts[name].ended)
            infos[name] = {"facts": facts[name]} | ({"ended": ENDINGS[over[name]]} if over[name] else {})
        self.agents = [name for name in live if not over[name]]
        return (
            {name: observations[name] for name in live},
            rewards,
            {name: 0 < over[name] < _TIMEOUT for name in live},
            {name: over[name] == _TIMEOUT for name in live},
            infos,
        )

    def render(self) -> Any:
        """The drive from above, around the first ego; `None` without `render_mode`."""
        if self.render_mode is None:
            return None
        if not self._before:
            raise ResetNeeded("reset() comes before render()")
        return picture(*self._egos.scene(0))


#: The name that PettingZoo's own environments have.
parallel_env = DrivingParallelEnv
