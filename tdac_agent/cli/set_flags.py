"""The flags of `tdac verify --set`, and which others they exclude."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from tdac_agent.cli.flags import TaskFlags
from tdac_agent.cli.robust_flags import RobustFlags
from tdac_envs.core.errors import TaskError


def check_set(
    name: str | None, own: Mapping[str, object], others: Mapping[str, object]
) -> None:
    """Refuses flags that do not belong together.

    Args:
        name: The task set, if any.
        own: Values of the flags that only a task set has, by flag.
        others: Values of the flags that only a single task has, by flag.

    Raises:
        TaskError: A flag does not belong to the others.
    """
    wrong = others if name is not None else own
    flag = next((flag for flag, value in wrong.items() if value is not None), None)
    if flag is None:
        return
    if name is None:
        raise TaskError(f"{flag} needs --set NAME; tdac sets lists the task sets")
    raise TaskError(f"--set brings its own tasks; leave out {flag}")


def task_words(task: TaskFlags) -> dict[str, object]:
    """The given flags of a single task, for `check_set`."""
    return {word: word for word in task.words() if word.startswith("--")}


@dataclass(frozen=True, slots=True)
class SetFlags:
    """The flags that name a task set and its worlds; see `tdac verify --help`."""

    name: str | None = None
    split: str | None = None
    worlds: int | None = None
    salt_file: Path | None = None
    hidden_folder: Path | None = None

    def check(
        self, task: TaskFlags, robust: RobustFlags, others: Mapping[str, object]
    ) -> None:
        """Refuses flags that do not belong together.

        Args:
            task: The flags of a single task.
            robust: The flags of a robust verification.
            others: Values of further flags that only a single task has.

        Raises:
            TaskError: A flag does not belong to the others.
        """
        if self.name is None:
            flags: dict[str, object] = {
                "--split": self.split,
                "--salt-file": self.salt_file,
                "--hidden-folder": self.hidden_folder,
                "-n": True,
            }
            flag = next(flag for flag, value in flags.items() if value)
            raise TaskError(f"{flag} needs --set NAME; tdac sets lists the task sets")
        if self.hidden_folder is not None and self.split != "hidden":
            raise TaskError("--hidden-folder needs --split hidden")
        words = [word for word in task.words() if word.startswith("--")]
        words += [flag for flag, value in others.items() if value]
        if robust != RobustFlags():
            words.append("--robust and its flags")
        if words:
            raise TaskError(f"--set brings its own tasks; leave out {words[0]}")
