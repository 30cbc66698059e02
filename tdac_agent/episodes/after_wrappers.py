"""What stable-baselines3's own wrappers do to observations, after Gymnasium's.

`VecNormalize` and `VecFrameStack`, for one robot, from plain numbers in `tdac.json`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated, Any, Literal

import numpy as np
from gymnasium import Space, spaces
from numpy.typing import NDArray
from pydantic import Field, FiniteFloat

from tdac_envs.core.errors import TaskError
from tdac_envs.core.strict_model import StrictModel

MOST_NUMBERS = 100_000
"""Most numbers in an observation, or in one entry of a `Dict`."""
_MOST_KEYS = 64
LARGEST = 1e30
"""Largest number that a network, in single precision, is to get."""
Numbers = Annotated[
    list[Annotated[float, Field(ge=-LARGEST, le=LARGEST)]],
    Field(max_length=MOST_NUMBERS),
]
Variances = Annotated[
    list[Annotated[FiniteFloat, Field(ge=0.0)]], Field(max_length=MOST_NUMBERS)
]


class Normalize(StrictModel):
    """`VecNormalize`: mean 0 and variance 1, by the statistics of the training."""

    kind: Literal["normalize"] = "normalize"
    mean: Numbers | Annotated[dict[str, Numbers], Field(max_length=_MOST_KEYS)] = Field(
        description="In the order of `ravel`."
    )
    var: Variances | Annotated[dict[str, Variances], Field(max_length=_MOST_KEYS)]
    clip: float = Field(10.0, gt=0.0, le=LARGEST)
    epsilon: float = Field(1e-8, gt=0.0, le=1.0)


class FrameStack(StrictModel):
    """`VecFrameStack`: the last observations beside each other, the newest last."""

    kind: Literal["frames"] = "frames"
    count: int = Field(ge=1, le=64)


Stage = Annotated[Normalize | FrameStack, Field(discriminator="kind")]


class Stages:
    """The stages of one episode, in their order.

    Args:
        stages: The stages, the innermost first.
        space: Space of the observations that they get.

    Attributes:
        space: Space of the observations that they give.

    Raises:
        TaskError: They do not fit the observations.
    """

    def __init__(self, stages: Sequence[Stage], space: Space[Any]) -> None:
        self._stages: list[Callable[[Any], Any]] = []
        self._held: list[dict[str | None, NDArray[Any]]] = []
        self.space = space
        for stage in stages:
            if isinstance(stage, Normalize):
                self._stages.append(_normalizing(stage, self.space))
            else:
                self._stages.append(self._stacking(stage.count))
            self.space = _like(self.space, stage)

    def reset(self) -> None:
        """Forgets the observations of the last episode."""
        for held in self._held:
            held.clear()

    def apply(self, observation: Any) -> Any:
        """The observation as the network gets it."""
        for stage in self._stages:
            observation = stage(observation)
        return observation

    def _stacking(self, count: int) -> Callable[[Any], Any]:
        held: dict[str | None, NDArray[Any]] = {}
        self._held.append(held)

        def stack(key: str | None, seen: NDArray[Any]) -> NDArray[Any]:
            wide = held.get(key)
            if wide is None:
                wide = np.zeros((*seen.shape[:-1], count * seen.shape[-1]), seen.dtype)
            shifted = np.roll(wide, -seen.shape[-1], axis=-1)
            shifted[..., -seen.shape[-1] :] = seen
            held[key] = shifted
            return shifted.copy()

        return lambda observation: _each(stack, observation)


def _normalizing(stage: Normalize, space: Space[Any]) -> Callable[[Any], Any]:
    numbers: dict[str | None, tuple[Any, Any]] = {}
    for key, own in _parts(space).items():
        means, variances = (
            each.get(key or "") if isinstance(each, dict) else each
            for each in (stage.mean, stage.var)
        )
        if means is None or variances is None:
            continue
        size = int(np.prod(own.shape or ()))
        if not len(means) == len(variances) == size:
            raise TaskError(
                f"the policy normalises {len(means)} numbers, and observes {size}"
            )
        shape = own.shape or ()
        numbers[key] = np.reshape(means, shape), np.reshape(variances, shape)
    if not numbers:
        raise TaskError("the policy normalises other observations than it gets")

    def normalize(key: str | None, seen: NDArray[Any]) -> NDArray[Any]:
        if key not in numbers:
            return seen
        mean, variance = numbers[key]
        scaled = (seen - mean) / np.sqrt(variance + stage.epsilon)
        clipped: NDArray[Any] = np.clip(scaled, -stage.clip, stage.clip)
        return clipped.astype(np.float32)

    return lambda observation: _each(normalize, observation)


def _like(space: Space[Any], stage: Stage) -> Space[Any]:
    """The space after a stage."""
    if isinstance(space, spaces.Dict):
        inner = {key: _like(own, stage) for key, own in space.spaces.items()}
        return spaces.Dict(inner)
    if not isinstance(space, spaces.Box) or not space.shape:
        raise TaskError(f"expected observations of numbers, got {space}")
    if isinstance(stage, FrameStack):
        size = stage.count * int(np.prod(space.shape))
        if size > MOST_NUMBERS:
            raise TaskError(
                f"the policy stacks {size:,} numbers (limit {MOST_NUMBERS:,}): use "
                "fewer frames"
            )
        low = np.repeat(space.low, stage.count, axis=-1)
        high = np.repeat(space.high, stage.count, axis=-1)
        return spaces.Box(low, high, dtype=space.dtype.type)
    return spaces.Box(-stage.clip, stage.clip, space.shape, np.float32)


def _parts(space: Space[Any]) -> dict[Any, Space[Any]]:
    if isinstance(space, spaces.Dict):
        return dict(space.spaces)
    return {None: space}


def _each(function: Callable[[str | None, Any], Any], observation: Any) -> Any:
    if isinstance(observation, dict):
        return {key: function(key, seen) for key, seen in observation.items()}
    return function(None, observation)
