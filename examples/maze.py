"""The training environment of the examples, and the success rate of training."""

from __future__ import annotations

from collections import deque
from typing import Any, ClassVar

import gymnasium as gym

from tdac_envs import wrap_for_rl

STEPS = 300_000
WINDOW, LEARNT = 100, 0.8
"""Number of episodes that count, and the success rate at which the maze is learnt."""


class Successes(gym.Wrapper[Any, Any, Any, Any]):
    """Counts the steps and successful episodes of all environments together."""

    steps = 0
    episodes = 0
    last: ClassVar[deque[bool]] = deque(maxlen=WINDOW)

    def step(self, action: Any) -> Any:
        """Runs one step; prints a line every 10,000 steps."""
        result = super().step(action)
        Successes.steps += 1
        if result[2] or result[3]:
            Successes.episodes += 1
            Successes.last.append(result[4]["is_success"])
        if Successes.steps % 10_000 == 0:
            print(progress_line(), flush=True)
        return result


def make_maze(**options: Any) -> Successes:
    """The maze with flat observations relative to the goal, and with guidance.

    Half of the episodes start at a random place on the map, and a contact costs 3
    instead of 10, as in `tdac train`. Actions are in [-3, 3], so that a standard
    deviation of 1, with which the examples start to explore, is a third of full speed.
    """
    env = gym.make(
        "TDAC-Map2D-v0",
        variation="mixed",
        reward_weights={"collision": 3.0},
        **options,
    )
    return Successes(gym.wrappers.RescaleAction(wrap_for_rl(env), -3.0, 3.0))


def success_rate() -> float:
    """The success rate of the last 100 episodes; 0 if there are fewer."""
    return sum(Successes.last) / WINDOW if len(Successes.last) == WINDOW else 0.0


def progress_line() -> str:
    """One line about the training so far."""
    return (
        f"{Successes.steps} steps, {Successes.episodes} episodes, "
        f"success of the last {WINDOW}: {success_rate():.2f}"
    )


def result_line() -> str:
    """One line about the whole training: whether the policy has learnt the maze."""
    learnt = success_rate() >= LEARNT
    return f"{progress_line()}: {'learnt' if learnt else 'not learnt'}"
