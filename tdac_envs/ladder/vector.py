"""The vector environments of TDAC-Ladder-v0."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

from tdac_envs.drive.vector import Actions, DrivenVectorEnv, Observations, Result
from tdac_envs.epuck.vector import EPuckVectorEnv
from tdac_envs.ladder.env import EPuckLadderEnv, LadderEnv, env_class
from tdac_envs.ladder.observed import ALWAYS, SetView, joined
from tdac_envs.map2d.vector import Map2DVectorEnv


class TaskSetVectorEnv(DrivenVectorEnv):
    """What the vector environments of both robots add for a task set.

    Attributes:
        view: What is observed.
    """

    view: SetView

    def _prepare(self) -> None:
        super()._prepare()
        self.view = view = self._first.view
        self._anchors = np.array([view.anchor(task) for task in self.tasks])

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observations, dict[str, Any]]:
        """Starts episodes, as `DrivenVectorEnv.reset` does."""
        whole, infos = super().reset(seed=seed, options=options)
        poses, none = self.pose(), np.zeros(self.num_envs, np.bool_)
        seen = self.view.seen(whole, self.observed_poses(), self._anchors)
        begun = infos[f"_{ALWAYS[0]}"]
        return seen, self.view.infos(infos, poses, none) | self._world_facts(begun)

    def step(self, actions: Actions) -> Result:
        """Runs one time step, as `DrivenVectorEnv.step` does."""
        before, begun = self._anchors.copy(), self._over.copy()
        whole, rewards, terminated, truncated, infos = super().step(actions)
        ended, view, poses = terminated | truncated, self.view, self.pose()
        seen = view.seen(whole, self.observed_poses(), self._anchors)
        if "final_obs" not in infos:
            infos = view.infos(infos, poses, ended) | self._world_facts(begun)
            return seen, rewards, terminated, truncated, infos
        final = infos.pop("final_obs")
        placed = view.placed(self.last_observed_poses, before)
        for i in np.flatnonzero(ended).tolist():
            own = {key: values[i].copy() for key, values in placed.items()}
            final[i] = view.chosen(view.sensed({**final[i], **own}))
        last = view.infos(infos.pop("final_info"), self.last_poses, ended)
        # The new episodes have not ended.
        infos = view.infos(infos, poses, np.zeros_like(ended))
        infos |= self._world_facts(ended)
        infos |= {
            "final_obs": final,
            "_final_obs": ended,
            "final_info": last,
            "_final_info": ended.copy(),
        }
        return seen, rewards, terminated, truncated, infos

    def _world_facts(self, begun: NDArray[np.bool_]) -> dict[str, Any]:
        """The infos about the worlds of the robots whose episodes have begun."""
        tasks = {i: self.tasks[i] for i in np.flatnonzero(begun).tolist()}
        facts = {i: task.world_facts for i, task in tasks.items() if task.world_facts}
        return joined(facts, self.num_envs)

    def _assign(self, i: int, task: Any) -> None:
        super()._assign(i, task)
        self._anchors[i] = self.view.anchor(task)


class LadderVectorEnv(
    TaskSetVectorEnv, Map2DVectorEnv, VectorEnv[Observations, Actions, Any]
):
    """A vector of `LadderEnv` that steps in one compiled call on all cores.

    Made by `gym.make_vec("TDAC-Ladder-v0", num_envs=64, level="unknown")`. Robot i
    behaves bit for bit as a `LadderEnv` does with the same seed and actions. The
    formats are those of Gymnasium's `SyncVectorEnv`.

    Args:
        num_envs: Number of robots.
        autoreset_mode: `"NextStep"`, `"SameStep"`, `"Disabled"`, or a member of
            `gymnasium.vector.AutoresetMode`.
        threads: Number of threads, which does not affect the results. Default: the
            number of cores.
        render_mode: `"rgb_array"`, for up to 64 robots, or None.
        **options: Arguments of `LadderEnv`, and `max_episode_steps`, as for
            `Map2DVectorEnv`.
    """

    make = LadderEnv


class EPuckLadderVectorEnv(
    TaskSetVectorEnv, EPuckVectorEnv, VectorEnv[Observations, Actions, Any]
):
    """A vector of `EPuckLadderEnv`, as `LadderVectorEnv` is one of `LadderEnv`."""

    make = EPuckLadderEnv


def make(
    num_envs: int = 1, level: str | Path = "unknown", **options: Any
) -> LadderVectorEnv | EPuckLadderVectorEnv:
    """The batch of a task set, as `gym.make_vec("TDAC-Ladder-v0")` calls it.

    Args:
        num_envs: Number of robots.
        level: Name of a task set, or path of a `set.yaml`.
        **options: Further arguments of `LadderVectorEnv`.

    Raises:
        TaskError: There is no such set, or an argument is not valid.
    """
    if env_class(level) is EPuckLadderEnv:
        return EPuckLadderVectorEnv(num_envs, level=level, **options)
    return LadderVectorEnv(num_envs, level=level, **options)
