"""Adapter from batched environments to Stable-Baselines3; needs the extra `sb3`.

```python
envs = SB3VecEnv(gym.make_vec("TDAC-Map2D-v0", 64, autoreset_mode="SameStep"))
PPO("MultiInputPolicy", envs).learn(1_000_000)
```
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from tdac_envs.core.errors import TaskError
from tdac_envs.core.extras import install_command
from tdac_envs.drive.vector import DrivenVectorEnv
from tdac_envs.learning.wrapped_vector import Seen, WrappedVectorEnv

try:
    from stable_baselines3.common.vec_env import VecEnv
except ImportError:
    raise ImportError(
        f"SB3VecEnv needs Stable-Baselines3: {install_command('sb3')}"
    ) from None

Indices = int | Iterable[int] | None


class SB3VecEnv(VecEnv):
    """A batch as a Stable-Baselines3 `VecEnv`; arrays are passed on without a copy.

    Filling a thousand `info` dictionaries would take longer than the step, so they are
    empty except in the last step of an episode: there, a robot's `info` is that of a
    single environment, with `terminal_observation` and `TimeLimit.truncated` added.

    Args:
        batch: Made with `autoreset_mode="SameStep"`; may be a `WrappedVectorEnv`.

    Raises:
        TaskError: It is not a batch of this package, or has another autoreset mode.
    """

    def __init__(self, batch: Any) -> None:
        if not isinstance(batch, DrivenVectorEnv | WrappedVectorEnv):
            raise TaskError(f"expected a batch made by gym.make_vec, got {batch}")
        mode = batch.metadata["autoreset_mode"]
        if mode is not AutoresetMode.SAME_STEP:
            raise TaskError(
                "expected a batch made with autoreset_mode='SameStep', got "
                f"{mode.value!r}"
            )
        self.batch = batch
        super().__init__(
            batch.num_envs, batch.single_observation_space, batch.single_action_space
        )
        # For Stable-Baselines3's `VecVideoRecorder`.
        self.metadata["render_fps"] = batch.metadata["render_fps"]

    def reset(self) -> Seen:
        """Starts all episodes with the values of `seed` and `set_options`."""
        if any(options != self._options[0] for options in self._options):
            raise TaskError("expected the same options for all robots")
        observations, infos = self.batch.reset(
            seed=list(self._seeds), options=self._options[0]
        )
        self.reset_infos = [_row(infos, i) for i in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        return observations

    def seed(self, seed: int | Sequence[int] | None = None) -> Sequence[int | None]:
        """Seeds the next `reset`.

        Args:
            seed: Seed of the first robot, with consecutive seeds for the others; or one
                seed for each robot.
        """
        if seed is None or isinstance(seed, int):
            return super().seed(seed)
        if len(seed) != self.num_envs:
            raise TaskError(f"expected {self.num_envs} seeds, got {len(seed)}")
        self._seeds = list(seed)
        return self._seeds

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Keeps the actions for `step_wait`."""
        self._actions = actions

    def step_wait(
        self,
    ) -> tuple[Seen, NDArray[Any], NDArray[np.bool_], list[dict[str, Any]]]:
        """Steps once; returns observations, rewards, dones and infos."""
        observations, rewards, terminated, truncated, info = self.batch.step(
            self._actions
        )
        over = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(over).tolist():
            infos[i] = _row(info["final_info"], i)
            infos[i]["TimeLimit.truncated"] = bool(truncated[i])
            infos[i]["terminal_observation"] = info["final_obs"][i]
        return observations, rewards.astype(np.float32), over, infos

    def get_images(self) -> Sequence[NDArray[np.uint8]]:
        """A frame of each robot, which `render` tiles."""
        frames: Any = self.batch.render()
        return list(frames)

    def close(self) -> None:
        """Stops the threads."""
        self.batch.close()

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        """The batch's attribute, once for each robot."""
        value = getattr(self.batch, attr_name)
        return [value for _ in self._get_indices(indices)]

    def set_attr(
        self,
        attr_name: str,
        value: Any,  # noqa: ARG002 - SB3's signature
        indices: Indices = None,  # noqa: ARG002
    ) -> None:
        """Not supported: the robots of a batch are not separate objects."""
        raise TaskError(f"cannot set {attr_name!r}: pass it to gym.make_vec")

    def env_method(
        self,
        method_name: str,
        *_: Any,
        indices: Indices = None,  # noqa: ARG002
        **__: Any,
    ) -> list[Any]:
        """Not supported: the robots of a batch are not separate objects."""
        raise TaskError(f"cannot call {method_name!r} for single robots of a batch")

    def env_is_wrapped(
        self,
        wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]],  # noqa: ARG002
        indices: Indices = None,
    ) -> list[bool]:
        """False for each robot: the robots of a batch are not wrapped."""
        return [False for _ in self._get_indices(indices)]


def _row(infos: dict[str, Any], i: int) -> dict[str, Any]:
    """The info of one robot, as plain Python values."""
    return {
        key: _row(value, i) if isinstance(value, dict) else value[i : i + 1].tolist()[0]
        for key, value in infos.items()
        if not key.startswith("_") and infos[f"_{key}"][i]
    }
