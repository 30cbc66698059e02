"""Seeds, masks, infos and spaces of many environments at once, as in Gymnasium."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from tdac_envs.core.errors import TaskError
from tdac_envs.drive import stepping

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Env = TypeVar("Env")

_INFOS: dict[str, tuple[int, type]] = {
    "is_success": (stepping.REACHED, np.bool_),
    "collision": (stepping.TOUCHED, np.bool_),
    "collisions": (stepping.COLLISIONS, np.int64),
    "clipped": (stepping.CLIPPED, np.int64),
    "distance_to_goal": (stepping.GAP, np.float64),
    "path_distance": (stepping.REMAINING, np.float64),
    "clearance": (stepping.ROOM, np.float64),
}


def ends_of(outcome: Array) -> tuple[Array, Flags, Flags]:
    """Rewards of a step, and whose episodes it terminated and truncated.

    Args:
        outcome: Shape (num_envs, entries).
    """
    ends = outcome[:, stepping.TERMINATED], outcome[:, stepping.TRUNCATED]
    terminated, truncated = (end != 0.0 for end in ends)
    return outcome[:, stepping.REWARD].copy(), terminated, truncated


def infos_of(outcome: Array, mask: Flags) -> dict[str, Any]:
    """The infos of the robots in the mask, each key with its own.

    Args:
        outcome: Shape (num_envs, entries), 0 out of the mask.
        mask: Shape (num_envs,).
    """
    infos: dict[str, Any] = {}
    for key, (entry, kind) in _INFOS.items():
        infos[key], infos[f"_{key}"] = outcome[:, entry].astype(kind), mask.copy()
    return infos


def autoreset_mode_of(given: str | AutoresetMode) -> AutoresetMode:
    """The mode that is meant.

    Raises:
        TaskError: There is no such mode.
    """
    try:
        return AutoresetMode(given)
    except ValueError:
        names = ", ".join(repr(mode.value) for mode in AutoresetMode)
        raise TaskError(
            f"expected autoreset_mode to be one of {names}, got {given!r}"
        ) from None


def several(
    make: Callable[..., Env], each: Any, options: dict[str, Any], count: int
) -> list[Env]:
    """The environments of a batch, one for each entry of `each`.

    Args:
        make: Makes one.
        each: Arguments that differ, as the caller of `make_vec` gave them.
        options: Arguments that they share.
        count: Of robots.

    Raises:
        TaskError: `each` is no list of such arguments, has more than there are robots,
            or an environment cannot be made: says which.
    """
    if not isinstance(each, Sequence) or not all(isinstance(e, Mapping) for e in each):
        raise TaskError(
            f"expected each to be a list of dicts of arguments, as [{{'delay': 1}}], "
            f"got {each!r}"
        )
    if len(each) > count:
        raise TaskError(f"each has {len(each)} entries for {count} robots")
    envs = []
    for number, more in enumerate(each or [{}]):
        try:
            envs.append(make(**{**options, **more}))
        except TaskError as error:
            if not more:
                raise
            raise TaskError(f"each[{number}]: {error}") from error
    return envs


def no_pictures(render_mode: object) -> None:
    """Refuses a mode of pictures.

    Raises:
        TaskError: There is one.
    """
    if render_mode is not None:
        raise TaskError(
            f"a batch draws nothing; expected render_mode None, or "
            f"vectorization_mode='sync', got {render_mode!r}"
        )


def joint_space(envs: Sequence[Any]) -> gym.spaces.Dict:
    """The observation space that holds those of all environments.

    Raises:
        TaskError: Their robots' memory is of several shapes, or they observe other
            things.
    """
    first = envs[0]
    shapes = [[array.shape for array in env.robot] for env in envs]
    if any(each != shapes[0] for each in shapes):
        rays = "n_rays and " if "ranges" in first.observation_space.spaces else ""
        raise TaskError(f"expected the same {rays}delay of all robots of a batch")
    keys = first.observation_space.keys()
    if any(env.observation_space.keys() != keys for env in envs):
        raise TaskError("expected the same sensors of all robots of a batch")
    bounds: dict[str, gym.Space[Any]] = {}
    for key, box in first.observation_space.items():
        others = [env.observation_space[key] for env in envs]
        low = np.min([each.low for each in others], axis=0)
        high = np.max([each.high for each in others], axis=0)
        bounds[key] = gym.spaces.Box(low, high, dtype=box.dtype)
    return gym.spaces.Dict(bounds)


def seeds_of(seed: Any, count: int) -> Sequence[int | None]:
    """A seed for each robot, from one number, one for each, or None.

    Raises:
        ValueError: There are more or fewer than robots.
    """
    if seed is None or isinstance(seed, int | np.integer):
        return [None if seed is None else int(seed) + i for i in range(count)]
    try:
        seeds = list(seed)
    except TypeError:
        raise ValueError(
            f"expected a whole number as seed, or {count} of them, got {seed!r}"
        ) from None
    if len(seeds) != count:
        raise ValueError(f"expected {count} seeds, one a robot, got {len(seeds)}")
    return seeds


def mask_of(given: Any, count: int) -> Flags:
    """Which robots are reset; all where nothing is given.

    Raises:
        ValueError: It is not a bool for each robot, or all are False.
    """
    if given is None:
        return np.ones(count, np.bool_)
    mask = np.asarray(given)
    if mask.dtype != np.bool_ or mask.shape != (count,) or not mask.any():
        raise ValueError(
            f"expected options['reset_mask'] to be {count} bools, one of them True at "
            f"least, got {given!r}"
        )
    return mask
