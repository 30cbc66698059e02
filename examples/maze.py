"""The maze as the examples train on it, and the success of their last episodes."""

from __future__ import annotations

from collections import deque
from typing import Any, ClassVar

import gymnasium as gym

from tdac_envs import wrap_for_rl

LAST, ENOUGH = 100, 0.8
STEPS = 300_000


class Successes(gym.Wrapper[Any, Any, Any, Any]):
    """Counts steps and successful episodes, of all environments together."""

    steps = 0
    episodes = 0
    last: ClassVar[deque[bool]] = deque(maxlen=LAST)

    def step(self, action: Any) -> Any:
        """Steps once, and prints a line every 10,000 steps."""
        result = super().step(action)
        Successes.steps += 1
        if result[2] or result[3]:
            Successes.episodes += 1
            Successes.last.append(result[4]["is_success"])
        if Successes.steps % 10_000 == 0:
            print(told(), flush=True)
        return result


def maze(**options: Any) -> Successes:
    """The maze with flat observations relative to the goal, and with guidance.

    Half of the episodes start anywhere on the map, and a contact costs 3 instead of 10,
    as in `tdac train`. Actions have the range [-3, 3], so that exploration with a
    standard deviation of 1 is a third of full speed: with more, the robot never passes
    a narrow gap.
    """
    env = gym.make(
        "TDAC-Map2D-v0",
        variation="mixed",
        reward_weights={"collision": 3.0},
        **options,
    )
    return Successes(gym.wrappers.RescaleAction(wrap_for_rl(env), -3.0, 3.0))


def success() -> float:
    """The share of the last 100 episodes that reached the goal; 0 before there are."""
    return sum(Successes.last) / LAST if len(Successes.last) == LAST else 0.0


def told() -> str:
    """One line about the training so far."""
    return (
        f"{Successes.steps} steps, {Successes.episodes} episodes, "
        f"success of the last {LAST}: {success():.2f}"
    )


def ended() -> str:
    """One line about the whole training: whether the policy has learnt the maze."""
    return f"{told()}: {'learnt' if success() >= ENOUGH else 'not learnt'}"
