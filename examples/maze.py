"""The training environment of the examples, and the success rate of training."""

from __future__ import annotations

from collections import deque
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from tdac_envs import wrap_for_rl

STEPS = 300_000
"""Steps of a training, of 0.2 s each."""
ANYWHERE = STEPS // 2
"""Until then, half of the episodes start anywhere on the map."""
WINDOW, LEARNT = 100, 0.8
"""Number of episodes that count, and the success rate at which the maze is learnt."""
LIMIT = 3.0
"""Actions are in [-LIMIT, LIMIT]; exploration starts with a standard deviation of 1."""


class Successes(gym.Wrapper[Any, Any, Any, Any]):
    """Counts the steps and successful episodes of all environments together."""

    steps = 0
    episodes = 0
    last: ClassVar[deque[bool]] = deque(maxlen=WINDOW)

    def step(self, action: Any) -> Any:
        """Runs one step; prints a line every 5,000 steps."""
        result = super().step(action)
        Successes.steps += 1
        if result[2] or result[3]:
            Successes.episodes += 1
            Successes.last.append(result[4]["is_success"])
        if Successes.steps % 5_000 == 0:
            print(progress_line(), flush=True)
        return result


class Starts(gym.Wrapper[Any, Any, Any, Any]):
    """Starts all episodes near the task's start, once the steps `ANYWHERE` are done.

    Starts anywhere show a policy the whole map before it can drive there, but some of
    them face a wall so closely that exploration noise alone ends the episode.
    """

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        """Starts an episode; the wrapped environment has the variation `mixed`."""
        if Successes.steps >= ANYWHERE:
            task: Any = self.get_wrapper_attr("nominal")
            options = {"start": tuple(task.jittered(self.np_random)), **(options or {})}
        return super().reset(seed=seed, options=options)


def make_maze(**options: Any) -> Successes:
    """The maze with flat observations relative to the goal, and with guidance.

    A step lasts 0.2 s instead of 0.05 s, so progress and time count four times as much
    per step. A contact costs 3 instead of 10, as in `tdac train`.
    """
    env = gym.make(
        "TDAC-Map2D-v0",
        dt=0.2,
        horizon=1000,
        variation="mixed",
        reward_weights={"progress": 0.4, "time": 0.04, "collision": 3.0},
        **options,
    )
    space = Box(-LIMIT, LIMIT, (2,), np.float32)
    env = gym.wrappers.TransformAction(wrap_for_rl(Starts(env)), wheel_speeds, space)
    return Successes(env)


def wheel_speeds(action: NDArray[np.float32]) -> NDArray[np.float32]:
    """Wheel speeds, left and right, for an action (speed, turn).

    The zero action drives straight ahead at half speed: a robot that explores around it
    moves on instead of trembling where it stands.
    """
    speed, turn = np.asarray(action) / LIMIT
    forward = (1.0 + speed) / 2.0
    wheels = np.array([forward - turn / 2.0, forward + turn / 2.0], np.float32)
    return np.clip(wheels, -1.0, 1.0)


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
