"""Stable-Baselines3 over many drives at once (`pip install stable-baselines3`).

>>> from stable_baselines3 import PPO
>>> from swerve.sb3 import DrivingVecEnv
>>> PPO("MultiInputPolicy", DrivingVecEnv(8, "person_behind_truck", level="target")).learn(100_000)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env.base_vec_env import VecEnv

from ._files import FileOrDict
from .gym import DrivingVectorEnv, Facts


class DrivingVecEnv(VecEnv):
    """Many drives of one scenario, as Stable-Baselines3 steps them.

    The arguments are those of `swerve.gym.DrivingVectorEnv`; numbers are normalised unless `normalize` says otherwise. A
    drive that is over begins anew in the same step; its last observation is in its info, `terminal_observation`. With one
    observed stream the policy is `MlpPolicy`, with several `MultiInputPolicy`.
    """

    def __init__(
        self,
        num_envs: int = 1,
        scenario: FileOrDict = "person_behind_truck",
        config: FileOrDict | None = None,
        *,
        seed: int | None = None,
        normalize: bool = True,
        **keywords: Any,
    ) -> None:
        self.drives = DrivingVectorEnv(
            num_envs, scenario, config, normalize=normalize, autoreset="same_step", **keywords
        )
        self._next_seed = seed
        self._actions: NDArray[np.float32] | None = None
        super().__init__(num_envs, self.drives.single_observation_space, self.drives.single_action_space)

    def seed(self, seed: int | None = None) -> list[int | None]:
        """Sets the seed of the next `reset`."""
        self._next_seed = seed
        return [seed] * self.num_envs

    def reset(self) -> Any:
        """Begins all drives."""
        observation, info = self.drives.reset(seed=self._next_seed)
        self._next_seed = None
        self.reset_infos = [{"facts": Facts._make(row)} for row in info["facts"].tolist()]
        return observation

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Takes the actions of the next step."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Goes on to the next decisions."""
        if self._actions is None:
            raise ValueError("step_async() comes before step_wait()")
        observation, rewards, terminated, truncated, info = self.drives.step(self._actions)
        self._actions = None
        infos: list[dict[str, Any]] = [{"facts": Facts._make(row)} for row in info["facts"].tolist()]
        for index in np.flatnonzero(terminated | truncated).tolist():
            infos[index]["ended"] = info["ended"][index]
            infos[index]["terminal_observation"] = info["final_obs"][index]
            infos[index]["TimeLimit.truncated"] = bool(truncated[index] and not terminated[index])
        return observation, rewards.astype(np.float32), terminated | truncated, infos

    def close(self) -> None:
        """Ends the drives."""
        self.drives.close()

    def _indices(self, indices: int | Sequence[int] | None) -> list[int]:
        return list(range(self.num_envs)) if indices is None else [indices] if isinstance(indices, int) else list(indices)

    def get_attr(self, attr_name: str, indices: int | Sequence[int] | None = None) -> list[Any]:
        """An attribute, which all drives share."""
        return [getattr(self.drives, attr_name)] * len(self._indices(indices))

    def set_attr(self, attr_name: str, value: Any, indices: int | Sequence[int] | None = None) -> None:
        """Refused: the drives have no attributes of their own."""
        raise AttributeError(f"{attr_name}: drives that are stepped together have no attributes of their own")

    def env_method(
        self, method_name: str, *arguments: Any, indices: int | Sequence[int] | None = None, **keywords: Any
    ) -> list[Any]:
        """Refused: the drives have no methods of their own."""
        raise AttributeError(f"{method_name}: drives that are stepped together have no methods of their own")

    def env_is_wrapped(self, wrapper_class: type, indices: int | Sequence[int] | None = None) -> list[bool]:
        """No drive is wrapped."""
        return [False] * len(self._indices(indices))
