"""The flags of `tdac synth --set`, and which others they exclude."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

from tdac_agent.cli.flags import TaskFlags
from tdac_envs.core.errors import TaskError


@dataclass(frozen=True, slots=True)
class SynthSetFlags:
    """The flags that concern task sets; see `tdac synth --help`."""

    name: str | None = None
    episodes: int | None = None
    feedback_episodes: int | None = None
    then_verify: bool = False

    def check(self, task: TaskFlags, others: Mapping[str, object]) -> None:
        """Refuses flags that do not belong together.

        Args:
            task: The flags of a single task.
            others: Values of further flags that only a single task has.

        Raises:
            TaskError: A flag does not belong to the others.
        """
        if self.name is None:
            flag = next(iter(self.settings()))
            raise TaskError(
                f"--{flag.replace('_', '-')} needs --set NAME; tdac sets lists the "
                "task sets"
            )
        words = [word for word in task.words() if word.startswith("--")]
        words += [flag for flag, value in others.items() if value]
        if words:
            raise TaskError(f"--set brings its own tasks; leave out {words[0]}")

    def settings(self) -> dict[str, object]:
        """Arguments of `synthesize` that were given, by name."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {
            name: value for name, value in values.items() if value and name != "name"
        }
