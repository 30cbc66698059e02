"""Seeds, reset masks, infos and spaces of a batch, in Gymnasium's formats."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from tdac_envs.core.arguments import whole_number
from tdac_envs.core.errors import TaskError
from tdac_envs.drive import stepping
from tdac_envs.physics.moved import EXACT

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Env = TypeVar("Env")

_INFOS: dict[str, tuple[int, type]] = {
    "is_success": (stepping.REACHED, np.bool_),
    "collision": (stepping.TOUCHED, np.bool_),
    "collisions": (stepping.COLLISIONS, np.int64),
    "clipped": (stepping.CLIPPED, np.int64),
    "distance_to_goal": (stepping.GOAL_DISTANCE, np.float64),
    "path_distance": (stepping.REMAINING, np.float64),
    "clearance": (stepping.CLEARANCE, np.float64),
}


def ends_of(outcome: Array) -> tuple[Array, Flags, Flags]:
    """Rewards, terminations and truncations of a step.

    Args:
        outcome: Shape (num_envs, entries).
    """
    ends = outcome[:, stepping.TERMINATED], outcome[:, stepping.TRUNCATED]
    terminated, truncated = (end != 0.0 for end in ends)
    return outcome[:, stepping.REWARD].copy(), terminated, truncated


def infos_of(outcome: Array, mask: Flags) -> dict[str, Any]:
    """The infos of a batch; each `key` has its mask as `_key`, as in Gymnasium.

    Args:
        outcome: Shape (num_envs, entries); 0 for robots outside the mask.
        mask: Shape (num_envs,), bool: the robots that have infos.
    """
    infos: dict[str, Any] = {}
    for key, (entry, kind) in _INFOS.items():
        infos[key], infos[f"_{key}"] = outcome[:, entry].astype(kind), mask.copy()
    return infos


def autoreset_mode_of(given: str | AutoresetMode) -> AutoresetMode:
    """The autoreset mode of this name or value.

    Raises:
        TaskError: The mode is unknown.
    """
    try:
        return AutoresetMode(given)
    except ValueError:
        names = ", ".join(repr(mode.value) for mode in AutoresetMode)
        raise TaskError(
            f"expected autoreset_mode to be one of {names}, got {given!r}"
        ) from None


def time_limit_of(max_episode_steps: int | None) -> float:
    """The steps after which episodes are truncated; inf for None.

    Raises:
        TaskError: It is not a whole number of at least 1.
    """
    if max_episode_steps is None:
        return math.inf
    return whole_number("max_episode_steps", max_episode_steps, 1)


def make_envs(
    make: Callable[..., Env], each: Any, options: dict[str, Any], count: int
) -> list[Env]:
    """The environments of a batch, one for each entry of `each`.

    Args:
        make: Class of the environments.
        each: Arguments of each environment; they override `options`.
        options: Arguments that all environments share.
        count: Number of robots.

    Raises:
        TaskError: `each` is not a list of dicts or is longer than `count`, or an
            environment cannot be made; the message names the entry.
    """
    if not isinstance(each, Sequence) or not all(isinstance(e, Mapping) for e in each):
        raise TaskError(
            f"expected each to be a list of dicts of arguments, e.g. [{{'delay': 1}}], "
            f"got {each!r}"
        )
    if len(each) > count:
        raise TaskError(f"each has {len(each)} entries for {count} robots; remove some")
    envs = []
    for number, more in enumerate(each or [{}]):
        try:
            envs.append(make(**{**options, **more}))
        except TaskError as error:
            if not more:
                raise
            raise TaskError(f"each[{number}]: {error}") from error
    return envs


def check_exact(envs: Sequence[Any]) -> None:
    """Checks that the compiled step moves all robots of a batch.

    Raises:
        TaskError: Another physics moves one of them.
    """
    for env in envs:
        if not env.setup.physics.is_exact:
            raise TaskError(
                f"a batch computes the exact step; expected physics={EXACT!r} or "
                f"vectorization_mode='sync', got physics={env.setup.physics.name!r}"
            )


def joint_space(envs: Sequence[Any]) -> gym.spaces.Dict:
    """The smallest observation space that contains those of all environments.

    Raises:
        TaskError: The environments differ in the shapes of their robots' arrays or in
            their sensors.
    """
    first = envs[0]
    shapes = [[array.shape for array in env.robot] for env in envs]
    if any(each != shapes[0] for each in shapes):
        rays = "n_rays and " if "ranges" in first.observation_space.spaces else ""
        raise TaskError(f"expected the same {rays}delay for all robots of a batch")
    keys = first.observation_space.keys()
    differ = {key for env in envs for key in keys ^ env.observation_space.keys()}
    if differ:
        raise TaskError(
            "expected the same sensors for all robots of a batch; not all observe "
            + ", ".join(sorted(differ))
        )
    bounds: dict[str, gym.Space[Any]] = {}
    for key, box in first.observation_space.items():
        others = [env.observation_space[key] for env in envs]
        low = np.min([each.low for each in others], axis=0)
        high = np.max([each.high for each in others], axis=0)
        bounds[key] = gym.spaces.Box(low, high, dtype=box.dtype)
    return gym.spaces.Dict(bounds)


def seeds_of(seed: Any, count: int) -> Sequence[int | None]:
    """The seed of each robot: `seed + i` for an int, else `seed[i]`, or None.

    Raises:
        ValueError: `seed` is neither an int nor one seed for each robot.
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
        raise ValueError(f"expected {count} seeds, one per robot, got {len(seeds)}")
    return seeds


def mask_of(given: Any, count: int) -> Flags:
    """The mask of robots to reset, shape (count,), bool.

    Args:
        given: `options["reset_mask"]`.
        count: Number of robots.

    Raises:
        TypeError: The mask is not an array of bools.
        ValueError: It is not one bool for each robot, or all are False.
    """
    # The same types of errors and the same words as in Gymnasium's `SyncVectorEnv`.
    name = "`options['reset_mask']` must"
    if not isinstance(given, np.ndarray):
        raise TypeError(f"{name} be a numpy array, got {type(given)}")
    if given.shape != (count,):
        raise ValueError(f"{name} have shape `({count},)`, got {given.shape}")
    if given.dtype != np.bool_:
        raise TypeError(f"{name} have `dtype=np.bool_`, got {given.dtype}")
    if not given.any():
        raise ValueError(
            f"{name} contain a boolean array with at least one True value, got "
            f"reset_mask={given}"
        )
    return given


def store_actions(actions: Any, commands: Array) -> None:
    """Stores the actions of a batch as commands for the kernel, which clips them.

    Args:
        actions: Wheel speeds, shape (num_envs, 2), as an array or as lists.
        commands: Overwritten, shape (num_envs, 2).

    Raises:
        ValueError: The actions are not two finite numbers for each robot.
    """
    try:
        given = np.asarray(actions)
        if given.shape == commands.shape:
            commands[:] = given
            if np.isfinite(commands).all():
                return
    except (TypeError, ValueError):
        pass
    raise ValueError(
        f"expected actions of two finite numbers in [-1, 1] for each of "
        f"{len(commands)} robots, got {_fault_in(actions, commands.shape)}"
    )


def _fault_in(actions: Any, expected: tuple[int, ...]) -> str:
    """A short description of invalid actions, for the error message."""
    shape = np.shape(actions) if isinstance(actions, np.ndarray) else None
    if shape is not None and shape != expected:
        return f"an array of shape {shape}"
    if shape is None or actions.dtype.kind not in "fiu":
        return reprlib.repr(actions)
    robot = int(np.flatnonzero(~np.isfinite(actions).all(axis=1))[0])
    return f"{actions[robot].tolist()} for robot {robot}"
