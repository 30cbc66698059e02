"""Reward of both environments, as a pure function of one step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from tdac_envs.core.arguments import non_negative, one_of
from tdac_envs.core.compiled import subkernel


class RewardWeights(NamedTuple):
    """Weights of the four reward terms.

    Attributes:
        progress: Reward per full-speed step of progress along the grid path.
        goal: Reward for reaching the goal.
        collision: Penalty for a step with a contact.
        time: Penalty for each step.
    """

    progress: float = 0.1
    goal: float = 10.0
    collision: float = 10.0
    time: float = 0.01


def weights_of(given: Mapping[str, float] | None) -> RewardWeights:
    """The reward weights, with the default for each name that is not given.

    Raises:
        TaskError: A name is unknown, or a weight is not a finite number of at least 0.
    """
    weights = {}
    for name, value in (given or {}).items():
        one_of("a name in reward_weights", name, RewardWeights._fields)
        weights[name] = non_negative(f"reward_weights[{name!r}]", value)
    return RewardWeights(**weights)


@subkernel
def step_reward(
    weights: RewardWeights, progress: float, reached: bool, collided: bool
) -> float:
    """Reward of one step.

    Args:
        weights: Weights of the terms.
        progress: Decrease of the remaining path length, in full-speed steps.
        reached: Whether the step reached the goal.
        collided: Whether the body touched an obstacle.
    """
    reward = weights.progress * progress - weights.time
    if reached:
        reward += weights.goal
    if collided:
        reward -= weights.collision
    return reward
