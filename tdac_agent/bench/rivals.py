"""Classical local planners as rivals: a controller file for each task set."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field

from tdac_agent.builtin.level import level_of
from tdac_envs.core.errors import TaskError
from tdac_envs.core.intake import TEXT_BYTES, parse_json, parse_yaml, read_file
from tdac_envs.ladder.task_sets import TaskSet

FOLDER = Path(__file__).with_name("planners")
"""Folder of their files."""
RIVALS, TUNED = "rivals.yaml", "tuned.json"


class _Rival(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    title: str
    paper: str
    parts: tuple[str, ...] = Field(description="Files of `parts`, before its own.")
    levels: tuple[str, ...] = Field(description="Levels whose observations it uses.")
    ranges: dict[str, tuple[float, float]] = Field(
        description="Constants of the file that are tuned, with their bounds."
    )


@dataclass(frozen=True, slots=True)
class Rival:
    """A planner as it drives on a set.

    Attributes:
        source: Its file, with the values that were chosen for the level.
        tuned: Whether values were chosen for this set; None if it has none.
    """

    source: str
    tuned: bool | None


def rival_names() -> tuple[str, ...]:
    """The names of all rivals."""
    return tuple(_known())


def rival_on(name: str, tasks: TaskSet) -> Rival:
    """A rival as it drives on a set.

    Raises:
        TaskError: It does not drive by what is observed there.
    """
    rival, level = _known()[name], level_of(tasks)
    if level not in rival.levels:
        known = ", ".join(rival.levels)
        raise TaskError(f"{name} needs what is observed in {known}")
    assert level is not None
    # Some sets with the observations of a level have values of their own; on the
    # others, those of the level are used.
    own = _tuned().get(name, {})
    values = own.get(tasks.name, own.get(level, {}))
    tuned = tasks.name in own if rival.ranges else None
    return Rival(with_values(source_of(name), values), tuned)


def levels_of(name: str) -> tuple[str, ...]:
    """The levels on which a rival drives."""
    return _known()[name].levels


def ranges_of(name: str) -> dict[str, tuple[float, float]]:
    """The constants of a rival that are tuned, with their bounds."""
    return _known()[name].ranges


def source_of(name: str) -> str:
    """The file of a rival with its own values, after the parts that it shares."""
    parts = [FOLDER / "parts" / f"{part}.py" for part in _known()[name].parts]
    files = [*parts, FOLDER / f"{name.replace('-', '_')}.py"]
    # raw read: shipped
    return "\n\n".join(file.read_text(encoding="utf-8") for file in files)


def with_values(source: str, values: dict[str, float]) -> str:
    """A file with other values of constants, each of them on a line `NAME = number`.

    Raises:
        ValueError: There is no such line.
    """
    for name, value in values.items():
        line = re.compile(rf"^{name} = .*$", re.MULTILINE)
        source, count = line.subn(f"{name} = {value!r}", source)
        if count != 1:
            raise ValueError(f"expected one line '{name} = ...', got {count}")
    return source


@cache
def _known() -> dict[str, _Rival]:
    data = parse_yaml(read_file(FOLDER / RIVALS, TEXT_BYTES))
    return {name: _Rival.model_validate(each) for name, each in data.items()}


@cache
def _tuned() -> dict[str, dict[str, dict[str, float]]]:
    """The chosen values, by rival and level; elsewhere, those of the file hold."""
    found: dict[str, dict[str, dict[str, float]]]
    found = parse_json(read_file(FOLDER / TUNED, TEXT_BYTES))
    return found
