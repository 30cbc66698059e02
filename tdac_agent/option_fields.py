"""Options of commands, declared once: a dataclass is flags, argument and record.

    @dataclass(frozen=True)
    class SynthOptions:
        iterations: int = option(20, "Maximum iterations.", "-K", least=1)

The command line makes a flag of each field (`tdac_agent.cli.typed_options`), and the
library takes the object, or its fields as keywords.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Flag:
    """How the command line shows a field.

    Attributes:
        help: What it does, in a sentence or two.
        names: Its flags; by default one that is made of the field's name.
        metavar: What stands for its value; by default it follows from the type.
        least: Smallest value.
        most: Largest value.
        panel: Heading under which the help shows it.
        type: Type of its value on the command line, if that differs from the field's.
        argument: Whether it is a word of its own, without a flag.
        needs: Another flag, without which it has no effect, as in `--robust N`.
        scope: `task` or `set` if only a single task or only a task set has it.
        identity: Whether a run with another value is another run; a resumed run then
            has the recorded value, and no other.
        recorded: Whether the record of a run keeps the value as it is, which must then
            be one of JSON. A resumed run takes it from the record, whoever made that;
            so an option that a user has to permit must not be recorded here.
    """

    help: str
    names: tuple[str, ...] = ()
    metavar: str | None = None
    least: float | None = None
    most: float | None = None
    panel: str | None = None
    type: Any = None
    argument: bool = False
    needs: str = ""
    scope: str = ""
    identity: bool = False
    recorded: bool = True


def option(default: Any, help: str, *names: str, **look: Any) -> Any:  # noqa: A002
    """A field of a dataclass that is also a flag.

    Args:
        default: Its default; `...` if it must be given.
        help: Its help text.
        names: Its flags; by default one that is made of the field's name.
        look: Further attributes of `Flag`.
    """
    flag = Flag(help, names, **look)
    return dataclasses.field(default=default, metadata={"flag": flag})


def flag_of(field: dataclasses.Field[Any]) -> Flag | None:
    """How the command line shows a field; None if it has no flag."""
    return field.metadata.get("flag")
