"""Evaluates a policy on worlds of a task set during its training."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_agent.training.curve import Point
from tdac_envs.learning.wrapped_vector import Seen, WrappedVectorEnv


def evaluate_on_worlds(model: Any, trials: WrappedVectorEnv) -> Point:
    """Drives robot i once through world i, with deterministic actions.

    Args:
        model: Model with a method `predict`.
        trials: The robots, which are not reset automatically.

    Returns:
        The results, with 0 steps, 0 seconds and no success rate in training (nan).
    """
    count = trials.num_envs
    seen = _begun(trials)
    ended = np.zeros(count, np.bool_)
    reached, hit = np.zeros(count), np.zeros(count)
    returns, lengths = np.zeros(count), np.zeros(count)
    state, over = None, np.ones(count, np.bool_)
    while not ended.all():
        actions, state = model.predict(seen, state, over, deterministic=True)
        seen, rewards, terminated, truncated, infos = trials.step(actions)
        returns[~ended] += rewards[~ended]
        lengths[~ended] += 1
        over = terminated | truncated
        first = over & ~ended
        if first.any():
            reached[first] = infos["is_success"][first]
            hit[first] = infos["collision"][first]
        ended |= over
        if over.any() and not ended.all():
            # World 0 is at hand: these robots' further episodes do not count.
            trials.reset(options={"index": 0, "reset_mask": over})

    def mean(values: NDArray[np.float64]) -> float:
        return round(float(values.mean()), 6)

    return Point(
        0, 0.0, mean(reached), mean(hit), mean(returns), mean(lengths), float("nan")
    )


def _begun(trials: WrappedVectorEnv) -> Seen:
    """The first observations, of robot i in world i."""
    rows: list[Any] = []
    # In descending order, so that the last world made is 0.
    for i in reversed(range(trials.num_envs)):
        mask = np.arange(trials.num_envs) == i
        seen, _ = trials.reset(options={"index": i, "reset_mask": mask})
        rows.append(
            {key: value[i] for key, value in seen.items()}
            if isinstance(seen, dict)
            else seen[i]
        )
    rows.reverse()
    if isinstance(rows[0], dict):
        return {key: np.stack([row[key] for row in rows]) for key in rows[0]}
    return np.stack(rows)
