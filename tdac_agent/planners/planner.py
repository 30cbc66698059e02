"""Classical local planners: a controller file for each problem."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache

from pydantic import BaseModel, ConfigDict, Field

from tdac_agent.builtin.level import level_of
from tdac_agent.planners.names import FOLDER, PLANNERS
from tdac_agent.tasks.task import Task
from tdac_envs.core.errors import TaskError
from tdac_envs.core.intake import TEXT_BYTES, parse_json, parse_yaml, read_file
from tdac_envs.ladder.task_sets import TaskSet
from tdac_envs.map2d.task import Map2DTask

TUNED = "tuned.json"
_IN_METRES = (
    ("    PARAMS = json.load(file)", "    PARAMS = in_pixels(json.load(file))"),
    ("def reset(obs):", "@by_pixels\ndef reset(obs):"),
    ("def policy(obs):", "@by_pixels\ndef policy(obs):"),
)
"""Lines of a planner that the part `metres` changes, and what they become."""


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    title: str
    paper: str
    parts: tuple[str, ...] = Field(description="Files of `parts`, before its own.")
    levels: tuple[str, ...] = Field(description="Levels whose observations it uses.")
    ranges: dict[str, tuple[float, float]] = Field(
        description="Constants of the file that are tuned, with their bounds."
    )


@dataclass(frozen=True, slots=True)
class Planner:
    """A planner as it drives on a problem.

    Attributes:
        source: Its file, with the values that were chosen for the level.
        tuned: Whether values were chosen for this problem; None if it has none.
    """

    source: str
    tuned: bool | None


def planner_on(name: str, problem: Task | TaskSet) -> Planner:
    """A planner as it drives on a set, or on a task on a map.

    Raises:
        TaskError: It does not drive by what is observed there.
    """
    entry, level = _known()[name], _level_of(problem)
    if level not in entry.levels:
        known = ", ".join(entry.levels)
        raise TaskError(f"{name} needs what is observed in {known} (on tasks: in px)")
    assert level is not None
    # Some sets with the observations of a level have values of their own; on the
    # others, those of the level are used.
    own = _tuned().get(name, {})
    values = own.get(problem.name, own.get(level, {}))
    tuned = problem.name in own if entry.ranges else None
    return Planner(with_values(source_on(name, problem), values), tuned)


def _level_of(problem: Task | TaskSet) -> str | None:
    """The level whose observations a problem has; None if there is none.

    Sets in metres that are like none in metres have those of one in px.
    """
    if isinstance(problem, TaskSet):
        return level_of(problem) or level_of(problem, any_unit=True)
    if problem.spec.env != Map2DTask.env_id or problem.spec.frame != "pixels":
        return None
    return "crowd" if problem.spec.movers else "known"


def levels_of(name: str) -> tuple[str, ...]:
    """The levels on which a planner drives."""
    return _known()[name].levels


def ranges_of(name: str) -> dict[str, tuple[float, float]]:
    """The constants of a planner that are tuned, with their bounds."""
    return _known()[name].ranges


def source_of(name: str) -> str:
    """The file of a planner with its own values, after the parts that it shares."""
    parts = [FOLDER / "parts" / f"{part}.py" for part in _known()[name].parts]
    files = [*parts, FOLDER / f"{name.replace('-', '_')}.py"]
    # raw read: shipped
    return "\n\n".join(file.read_text(encoding="utf-8") for file in files)


def source_on(name: str, problem: Task | TaskSet) -> str:
    """The file of a planner with its own values, for the units of a problem."""
    source = source_of(name)
    if not isinstance(problem, TaskSet) or problem.file.resolution is None:
        return source
    for line, changed in _IN_METRES:
        source = _replaced(source, re.escape(line), changed)
    # raw read: shipped
    metres = (FOLDER / "parts" / "metres.py").read_text(encoding="utf-8")
    return f"{metres}\n\n{source}"


def with_values(source: str, values: dict[str, float]) -> str:
    """A file with other values of constants, each of them on a line `NAME = number`.

    Raises:
        ValueError: There is no such line.
    """
    for name, value in values.items():
        source = _replaced(source, f"{name} = .*", f"{name} = {value!r}")
    return source


def _replaced(source: str, line: str, by: str) -> str:
    """A file with another line instead of the only one that an expression matches."""
    source, count = re.subn(f"^{line}$", by, source, flags=re.MULTILINE)
    if count != 1:
        raise ValueError(f"expected one line '{line}', got {count}")
    return source


@cache
def _known() -> dict[str, _Entry]:
    data = parse_yaml(read_file(PLANNERS, TEXT_BYTES))
    return {name: _Entry.model_validate(each) for name, each in data.items()}


@cache
def _tuned() -> dict[str, dict[str, dict[str, float]]]:
    """The chosen values, by planner and level; elsewhere, those of the file hold."""
    found: dict[str, dict[str, dict[str, float]]]
    found = parse_json(read_file(FOLDER / TUNED, TEXT_BYTES))
    return found
