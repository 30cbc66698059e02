"""An environment's interface in words: from its own spaces and its manual page."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from tdac_agent.setting import JudgedEnv

_ROW = re.compile(r"^\| `(\w+)` \|(.*)\|$")


class ManualError(ValueError):
    """A manual page and a space contradict each other."""


class Interface(NamedTuple):
    """What a prompt tells of an environment.

    Attributes:
        description: Of the world and the motion.
        observation: A table of the keys, and what is to be known beside it.
        action: The space, and what it means.
    """

    description: str
    observation: str
    action: str


def interface_of(env: JudgedEnv) -> Interface:
    """The interface of an environment as it was made, options and all.

    Shapes and limits are those of its spaces; units and meanings those of its
    docstring.

    Raises:
        ManualError: They contradict each other.
    """
    sections = _sections(type(env))
    return Interface(
        sections["Description"],
        _observation(env.observation_space, sections["Observation Space"]),
        _action(env.action_space, sections["Action Space"]),
    )


def _sections(env: type) -> dict[str, str]:
    """The `##` sections of a docstring."""
    text = inspect.cleandoc(env.__doc__ or "")
    parts = re.split(r"^## (.+)$", text, flags=re.MULTILINE)
    return {
        title.strip(): body.strip()
        for title, body in zip(parts[1::2], parts[2::2], strict=True)
    }


def _observation(space: spaces.Space[Any], text: str) -> str:
    """The rows of the manual for the keys that there are, with shape and range.

    Raises:
        ManualError: A key has no row, or no box.
    """
    assert isinstance(space, spaces.Dict)
    told = dict(_rows(text))
    unknown = [key for key in space if key not in told]
    if unknown:
        raise ManualError(f"the manual page has no row for {', '.join(unknown)}")
    rows = ["| key | shape | range | unit | content |", "|---|---|---|---|---|"]
    for key, (_, unit, content) in told.items():
        if key in space.keys():  # noqa: SIM118 - a Dict space has no `in`
            box = space[key]
            assert isinstance(box, spaces.Box)
            limits = f"{_limit(box.low)} to {_limit(box.high)}"
            rows.append(f"| `{key}` | {box.shape} | {limits} | {unit} | {content} |")
    _, _, rest = text.rpartition("|\n")
    return "\n".join([*rows, "", rest.strip()]).rstrip()


def _rows(text: str) -> Iterator[tuple[str, list[str]]]:
    """Key and the other cells of each row of the manual's table."""
    for line in text.splitlines():
        match = _ROW.match(line)
        if match:
            yield match[1], [cell.strip() for cell in match[2].split("|")]


def _limit(values: NDArray[np.floating]) -> str:
    """`0`, or `(-0.5, -0.5, -3.142)` where not all are equal."""
    flat = [f"{value:.4g}" for value in values.ravel().tolist()]
    return flat[0] if len(set(flat)) == 1 else f"({', '.join(flat)})"


def _action(space: spaces.Space[Any], text: str) -> str:
    """The manual's words for the action.

    Raises:
        ManualError: They begin with another space.
    """
    assert isinstance(space, spaces.Box)
    low, high = _limit(space.low), _limit(space.high)
    real = f"`Box({low}, {high}, {space.shape}, {space.dtype})`"
    if not text.startswith(real):
        raise ManualError(f"the manual page must begin its action space with {real}")
    return text
