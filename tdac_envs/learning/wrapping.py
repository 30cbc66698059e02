"""Wraps an environment for reinforcement learning in one call."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, overload

from gymnasium.vector import VectorEnv

from tdac_envs.learning.wrapped_vector import WrappedVectorEnv
from tdac_envs.learning.wrappers import Env, wrap

FOR_RL = ("goal-relative", "guidance", "flatten")
"""The wrappers of `tdac train` on tasks, innermost first."""


@overload
def wrap_for_rl(
    env: VectorEnv[Any, Any, Any], names: Sequence[str] | None = None
) -> WrappedVectorEnv: ...


@overload
def wrap_for_rl(env: Env, names: Sequence[str] | None = None) -> Env: ...


def wrap_for_rl(
    env: Env | VectorEnv[Any, Any, Any], names: Sequence[str] | None = None
) -> Env | WrappedVectorEnv:
    """Makes observations flat, scaled to [-1, 1], and relative to robot and goal.

        env = wrap_for_rl(gym.make("TDAC-Map2D-v0"))
        envs = wrap_for_rl(gym.make_vec("TDAC-Map2D-v0", 64))
        envs = gym.make_vec("TDAC-Map2D-v0", 8, "async", wrappers=[wrap_for_rl])

    An observation is one float32 array, with these parts in alphabetical order:

    | part | size | content |
    |---|---|---|
    | `goal` | 3 | direction of the goal in the robot's frame, and its distance |
    | `guidance` | 2 | the next waypoint of the shortest path with a margin |
    | `ranges` or `ps` | n | reading / largest possible reading |
    | `wheel_speeds` | 2 | left, right, as last applied |

    Guidance is computed from the whole map; `names=("goal-relative", "flatten")` omits
    it, for policies that use only sensors and the goal. On a task set
    (`TDAC-Ladder-v0`) there is no guidance. There, ranges are closeness by default;
    where the robot has no pose, the goal is relative to the pose that its odometry adds
    up to. A view of the map, where the set gives one, is the wrapper `map-view`.
    Rewards, actions and the ends of episodes do not change. `tdac train` uses this
    function.

    Args:
        env: An environment, single or batched, with its original observations.
        names: Names in `tdac_envs.wrappers.WRAPPERS`, innermost first. By default
            the names that `default_wrappers` returns.

    Raises:
        TaskError: `env` is not from `tdac_envs`, a name is unknown, or a
            wrapper does not support the observations.
    """
    if names is None:
        names = default_wrappers(env)
    if isinstance(env, VectorEnv):
        return WrappedVectorEnv(env, names)
    return wrap(env, names)


def default_wrappers(env: Env | VectorEnv[Any, Any, Any]) -> tuple[str, ...]:
    """The names that `wrap_for_rl` chooses for an environment, single or batched.

    Returns:
        `FOR_RL`; on a task set `goal-relative` and `flatten`, with `closeness` if the
        robot has ranges.
    """
    plain: Any = env.unwrapped
    setups = getattr(plain, "setups", None) or [getattr(plain, "setup", None)]
    source = getattr(setups[0], "source", None)
    if source is None:
        return FOR_RL
    seen: Any = getattr(env, "single_observation_space", env.observation_space)
    ranges = ("closeness",) if "ranges" in seen.spaces else ()
    return "goal-relative", *ranges, "flatten"
