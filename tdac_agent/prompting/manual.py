"""An environment's interface in words: from its own spaces and its manual page."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

from gymnasium import spaces

from tdac_agent.tasks.setting import JudgedEnv

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
            rows.append(
                f"| `{key}` | {box.shape} | {_limits(box)} | {unit} | {content} |"
            )
    _, _, rest = text.rpartition("|\n")
    return "\n".join([*rows, "", rest.strip()]).rstrip()


def _rows(text: str) -> Iterator[tuple[str, list[str]]]:
    """Key and the other cells of each row of the manual's table."""
    for line in text.splitlines():
        match = _ROW.match(line)
        if match:
            yield match[1], [cell.strip() for cell in match[2].split("|")]


def _limits(box: spaces.Box) -> str:
    """`0 to 220`, or `(-0.5, -3.142) to (99.5, 3.142)` where the numbers differ."""
    ends = (box.low, box.high)
    flat = [[f"{v:.4g}" for v in end.ravel().tolist()] for end in ends]
    if all(len(set(numbers)) == 1 for numbers in flat):
        return " to ".join(numbers[0] for numbers in flat)
    return " to ".join(f"({', '.join(numbers)})" for numbers in flat)


def _action(space: spaces.Space[Any], text: str) -> str:
    """The manual's words for the action.

    Raises:
        ManualError: They begin with another space.
    """
    assert isinstance(space, spaces.Box)
    limits = _limits(space).replace(" to ", ", ")
    real = f"`Box({limits}, {space.shape}, {space.dtype})`"
    if not text.startswith(real):
        raise ManualError(f"the manual page must begin its action space with {real}")
    return text
