"""Descriptions of an environment's interface and of `sensors.py`, from their source."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Collection
from typing import Any, NamedTuple

from gymnasium import spaces

from tdac_agent.tasks.setting import JudgedEnv

_ROW = re.compile(r"^\| `(\w+)` \|(.*)\|$")


OTHER_SCANNERS = "Other Scanners"
"""Section of the remarks on rays that are no even fan."""


class ManualError(ValueError):
    """An environment's docstring contradicts its spaces."""


class Interface(NamedTuple):
    """Texts for the prompt about an environment.

    Attributes:
        description: World and motion.
        observation: Table of the keys, and remarks.
        action: Action space and its meaning.
    """

    description: str
    observation: str
    action: str


def interface_of(env: JudgedEnv) -> Interface:
    """Describes the interface of an environment with its options.

    Shapes and limits are taken from its spaces, units and meanings from its docstring.

    Raises:
        ManualError: They contradict each other.
    """
    sections = _sections(type(env))
    observation = _observation(env.observation_space, sections["Observation Space"])
    robot = getattr(getattr(env, "nominal", None), "robot", None)
    if robot is not None and not robot.has_even_fan:
        table, _, _ = observation.rpartition("|\n")
        observation = f"{table}|\n\n{sections[OTHER_SCANNERS]}"
    return Interface(
        sections["Description"],
        observation,
        _action(env.action_space, sections["Action Space"]),
    )


def _sections(env: type) -> dict[str, str]:
    """Returns the `##` sections of a docstring by title."""
    text = inspect.cleandoc(env.__doc__ or "")
    parts = re.split(r"^## (.+)$", text, flags=re.MULTILINE)
    return {
        title.strip(): body.strip()
        for title, body in zip(parts[1::2], parts[2::2], strict=True)
    }


def _observation(space: spaces.Space[Any], text: str) -> str:
    """Returns the docstring's rows for the keys of the space, with shape and range."""
    assert isinstance(space, spaces.Dict)
    # The key and the other cells of each row of the docstring's table.
    documented = {
        match[1]: [cell.strip() for cell in match[2].split("|")]
        for match in map(_ROW.match, text.splitlines())
        if match
    }
    unknown = [key for key in space if key not in documented]
    if unknown:
        raise ManualError(f"the docstring has no row for {', '.join(unknown)}")
    rows = ["| key | shape | range | unit | content |", "|---|---|---|---|---|"]
    for key, (_, unit, content) in documented.items():
        if key in space.keys():  # noqa: SIM118 - a Dict space has no `in`
            box = space[key]
            assert isinstance(box, spaces.Box)
            rows.append(
                f"| `{key}` | {box.shape} | {_limits(box)} | {unit} | {content} |"
            )
    _, _, rest = text.rpartition("|\n")
    return "\n".join([*rows, "", rest.strip()]).rstrip()


def _limits(box: spaces.Box) -> str:
    """Formats limits: `0 to 220`, or `(-0.5, -3.142) to (99.5, 3.142)`."""
    ends = (box.low, box.high)
    flat = [[f"{v:.4g}" for v in end.ravel().tolist()] for end in ends]
    if all(len(set(numbers)) == 1 for numbers in flat):
        return " to ".join(numbers[0] for numbers in flat)
    return " to ".join(f"({', '.join(numbers)})" for numbers in flat)


def _action(space: spaces.Space[Any], text: str) -> str:
    assert isinstance(space, spaces.Box)
    limits = _limits(space).replace(" to ", ", ")
    real = f"`Box({limits}, {space.shape}, {space.dtype})`"
    if not text.startswith(real):
        raise ManualError(f"the section Action Space must begin with {real}")
    return text


FOR_PEOPLE = ("Graphics", "show")
"""Names in `sensors.py` that only draw; a signature and docstring are enough."""


def needed_part(source: str, without: Collection[str] = ()) -> str:
    """Returns the part of `sensors.py` that a controller may use, verbatim.

    Args:
        source: The file.
        without: Functions of no use for the task.
    """
    lines, kept = source.splitlines(), []
    module = ast.parse(source)
    for node in module.body:
        first, last = node.lineno, node.end_lineno
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            if node.name.startswith("_") or node.name in without:
                continue
            kept.append("\n")
            if node.name in FOR_PEOPLE:
                last = node.body[0].end_lineno
        elif isinstance(node, ast.Import | ast.ImportFrom):
            continue
        kept.append("\n".join(lines[first - 1 : last]))
        if getattr(node, "name", "") in FOR_PEOPLE:
            kept.append("    ...")
    return "\n".join(kept)
