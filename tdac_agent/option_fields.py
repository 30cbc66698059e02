"""Options of commands, declared once: a dataclass is flags, argument and record.

    @dataclass(frozen=True)
    class SynthOptions:
        iterations: int = option(20, "Maximum iterations.", "-K", least=1)

The command line makes a flag of each field (`tdac_agent.cli.typed_options`), and the
library takes the object, or its fields as keywords.
"""

from __future__ import annotations

import dataclasses
import sys
from dataclasses import dataclass
from typing import Any, get_args, get_origin


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


def flag_name(field: dataclasses.Field[Any]) -> str:
    """The flag of a field, as in `--robot-radius`; the first if it has several."""
    flag = flag_of(field)
    if flag is not None and flag.argument:
        return flag.metavar or field.name.upper()
    names = flag.names if flag else ()
    first = names[0].partition("/")[0] if names else ""
    return first or f"--{field.name.replace('_', '-')}"


def flags_of(kind: Any) -> dict[str, tuple[dataclasses.Field[Any], Flag, Any]]:
    """The fields of a dataclass that have flags, with these and their types."""
    flags = {}
    for field in dataclasses.fields(kind):
        flag = flag_of(field)
        if flag is not None:
            flags[field.name] = field, flag, flag.type or _type_of(kind, field.name)
    return flags


def _type_of(kind: Any, name: str) -> Any:
    """The type of a field; types of others need not be imported."""
    for owner in kind.__mro__:
        hint = vars(owner).get("__annotations__", {}).get(name)
        if hint is not None:
            module = vars(sys.modules[owner.__module__])
            return eval(hint, module) if isinstance(hint, str) else hint
    raise TypeError(f"{kind.__name__} has no field {name}")


def item_of(hint: Any) -> Any:
    """The type of an item if a value is a tuple of any length, else None."""
    for each in (hint, *get_args(hint)):
        if get_origin(each) is tuple and get_args(each)[-1] is ...:
            return get_args(each)[0]
    return None


def typed_fields(options: Any) -> list[dataclasses.Field[Any]]:
    """The fields with flags whose values are not the defaults."""
    fields = [each for each in dataclasses.fields(options) if flag_of(each)]
    return [each for each in fields if getattr(options, each.name) != each.default]


def words_of(options: Any) -> list[str]:
    """The command line words that repeat the values, without defaults."""
    words: list[str] = []
    for field, flag, hint in flags_of(type(options)).values():
        value = getattr(options, field.name)
        if value == field.default or flag.argument:
            continue
        if isinstance(value, bool):
            words.append(flag_name(field) if value else flag.names[0].split("/")[1])
        elif item_of(hint) is not None:
            words += [
                word for each in value for word in (flag_name(field), _word(each))
            ]
        else:
            values = value if isinstance(value, tuple) else (value,)
            words += [flag_name(field), *map(_word, values)]
    return words


def _word(value: object) -> str:
    """A value as typed on a command line; a number keeps all its digits."""
    return repr(value).removesuffix(".0") if isinstance(value, float) else str(value)
