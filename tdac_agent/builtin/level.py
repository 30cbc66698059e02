"""Provider `builtin` for task sets: a hand-written controller for each level."""

from __future__ import annotations

from pathlib import Path

from tdac_agent.builtin.variation import varied
from tdac_agent.models.provider import PermanentFault, Reply, Request
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.set_file import set_names
from tdac_envs.ladder.task_sets import TaskSet, load_set

LEVELS = Path(__file__).with_name("levels")
"""Folder of the controllers, by the name of their level."""


class LevelController:
    """A provider that answers with the controller of a level; see `Provider`.

    Asked to improve a controller, it answers with other constants.

    Args:
        tasks: The task set.

    Attributes:
        missing: Why it cannot answer; empty if there is a controller.
    """

    name = "builtin"
    paid = False
    fixed = True

    def __init__(self, tasks: TaskSet) -> None:
        level = level_of(tasks)
        self._file = LEVELS / f"{level}.py"
        instead = "name a model with --learner"
        self.missing = () if level is not None else (_none_for(tasks, instead),)

    def complete(self, request: Request) -> Reply:
        """Answers one request; see `Provider`. Adds no rules.

        Raises:
            PermanentFault: There is no controller for what is observed in the set.
        """
        if self.missing:
            raise PermanentFault(self.missing[0])
        if request.kind == "summarise":
            return Reply("```json\n[]\n```\n")
        if request.kind == "improve":
            source, notes = varied(request.controller or "", request.sample)
            return Reply(f"```python\n{source}```\n", notes=notes)
        source = self._file.read_text(encoding="utf-8")  # raw read: shipped
        note = f"the built-in controller of the level {self._file.stem}"
        return Reply(f"```python\n{source}```\n", notes=(note,))


def controller_of(tasks: TaskSet, instead: str) -> Path:
    """The file of our own controller for a set.

    Args:
        tasks: The task set.
        instead: What to do without one, for the message.

    Raises:
        TaskError: There is none.
    """
    level = level_of(tasks)
    if level is None:
        raise TaskError(_none_for(tasks, instead))
    return LEVELS / f"{level}.py"


def _none_for(tasks: TaskSet, instead: str) -> str:
    known = ", ".join(path.stem for path in sorted(LEVELS.glob("*.py")))
    return (
        f"no built-in controller for the task set {tasks.name} (only for {known}, and "
        f"for sets with the same observations): {instead}"
    )


def level_of(tasks: TaskSet, any_unit: bool = False) -> str | None:
    """The level with a built-in controller whose observations are those of a set.

    A set with the name of a level has only the controller of this level.

    Args:
        tasks: The task set.
        any_unit: Whether the observations may be in other units.
    """
    given = _given(tasks)[: -1 if any_unit else None]
    equal = [k for k in set_names() if _given(load_set(k))[: len(given)] == given]
    names = [tasks.name] if tasks.name in equal else equal
    return next((name for name in names if (LEVELS / f"{name}.py").is_file()), None)


def _given(tasks: TaskSet) -> tuple[frozenset[str], str, bool, bool, str]:
    file = tasks.file
    seen = frozenset(file.observed)
    return seen, file.frame, file.map, bool(file.movers), file.shown_unit
