"""Makes a flag of each field of an options dataclass.

    @app.command()
    @typed_options("bench:run")
    def bench(options: BenchOptions) -> None: ...

The fields are declared with `tdac_agent.option_fields.option`. The command is called
with the objects, so that a new field needs no other line here.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import math
from collections.abc import Callable, Collection, Iterable, Sequence
from importlib import import_module
from typing import Annotated, Any, get_args, get_type_hints

import typer

from tdac_agent.cli.mistakes import begun
from tdac_agent.option_fields import (
    Flag,
    flag_name,
    flag_of,
    flags_of,
    item_of,
    typed_fields,
)

Command = Callable[..., Any]


def typed_options(
    work: str | None = None, *, without: Collection[str] = ()
) -> Callable[[Command], Command]:
    """Replaces each parameter whose type is a dataclass by flags for its fields.

    Args:
        work: What the command runs, with its arguments: a function of a module of
            `tdac_agent.cli`, as in `bench:run`, which is imported when it runs. By
            default, the command itself.
        without: Names of fields that the command has no flags for; they keep their
            defaults.
    """
    return lambda command: _WithFlags(command, work, without)


class _WithFlags:
    """A command with flags. Typer reads signature and annotations if it needs them."""

    def __init__(
        self, command: Command, work: str | None, without: Collection[str]
    ) -> None:
        functools.update_wrapper(self, command, ("__name__", "__doc__", "__module__"))
        self._command, self._work, self._without = command, work, without

    @functools.cached_property
    def _kinds(self) -> dict[str, Any]:
        """The dataclasses by parameter."""
        hints = get_type_hints(self._command)
        return {n: hint for n, hint in hints.items() if dataclasses.is_dataclass(hint)}

    @functools.cached_property
    def __signature__(self) -> inspect.Signature:
        hints = get_type_hints(self._command, include_extras=True)
        parameters: dict[str, inspect.Parameter] = {}
        for own in inspect.signature(self._command).parameters.values():
            added = [own.replace(annotation=hints[own.name])]
            if own.name in self._kinds:
                added = list(_flags(self._kinds[own.name], self._without))
            for each in added:
                assert each.name not in parameters, f"two options named {each.name}"
                parameters[each.name] = each.replace(
                    kind=inspect.Parameter.KEYWORD_ONLY
                )
        return inspect.Signature([*parameters.values()])

    @property
    def __annotations__(self) -> dict[str, Any]:  # type: ignore[override]
        return {n: p.annotation for n, p in self.__signature__.parameters.items()}

    def __call__(self, **values: Any) -> Any:
        options = {name: _object(kind, values) for name, kind in self._kinds.items()}
        check_needs(options.values())
        return self._loaded()(**values, **options)

    def _loaded(self) -> Command:
        """The function that does the work; its imports may take seconds."""
        if self._work is None:
            return self._command
        module, _, name = self._work.partition(":")
        with begun():
            work: Command = getattr(import_module(f"tdac_agent.cli.{module}"), name)
        return work


def _flags(kind: Any, without: Collection[str]) -> Iterable[inspect.Parameter]:
    for name, (field, flag, hint) in flags_of(kind).items():
        if name in without:
            continue
        look: dict[str, Any] = {
            "help": flag.help,
            "metavar": flag.metavar or _metavar(hint),
            "min": flag.least,
            "max": flag.most,
            "rich_help_panel": flag.panel,
        }
        made = typer.Argument if flag.argument else typer.Option
        names = () if flag.argument else flag.names or (flag_name(field),)
        default = inspect.Parameter.empty if field.default is ... else field.default
        if _is_unset(field.default, flag):
            default = None
        yield inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            default=default,
            annotation=Annotated[_on_command_line(hint, default), made(*names, **look)],
        )


def _is_unset(default: Any, flag: Flag) -> bool:
    """Whether a default stands for a flag that was not typed: nobody can type it."""
    return default == () or (
        flag.least is not None and isinstance(default, int) and default < flag.least
    )


def _metavar(hint: Any) -> str | None:
    """`N` for a number; typer's own for another type."""
    return "N" if {int, float} & {hint, *get_args(hint)} else None


def _on_command_line(hint: Any, default: Any) -> Any:
    """The type that Typer reads: lists for tuples of any length."""
    item: Any = item_of(hint)
    read = hint if item is None else list[item]
    return read | None if default is None else read


def _object(kind: Any, typed: dict[str, Any]) -> Any:
    """The options; takes their values out of those of the command line."""
    values = {}
    for name, (field, *_) in flags_of(kind).items():
        if name not in typed:
            continue
        value = typed.pop(name)
        if isinstance(value, list):
            value = tuple(value)
        if value is None or value == ():
            value = field.default
        _check_finite(flag_name(field), value)
        values[name] = value
    return kind(**values)


def _check_finite(flag: str, value: Any) -> None:
    """Refuses `nan` and `inf`, which the command line parses as numbers.

    Raises:
        TaskError: A number is not finite.
    """
    numbers = value if isinstance(value, tuple) else (value,)
    if any(isinstance(each, float) and not math.isfinite(each) for each in numbers):
        from tdac_envs.core.errors import TaskError

        raise TaskError(f"{flag} must be finite, got {' '.join(map(str, numbers))}")


def check_needs(options: Iterable[Any]) -> None:
    """Refuses flags that have no effect without another one that they need.

    Raises:
        TaskError: There are such flags.
    """
    typed = [(each, flag_of(each)) for own in options for each in typed_fields(own)]
    there = {flag_name(field) for field, _ in typed}
    there |= {name for _, flag in typed if flag for name in flag.names}
    needing: dict[str, list[dataclasses.Field[Any]]] = {}
    for field, flag in typed:
        if flag is not None and flag.needs and flag.needs.split()[0] not in there:
            needing.setdefault(flag.needs, []).append(field)
    for needed, fields in needing.items():
        require_flag(needed, fields)


def require_flag(needed: str, fields: Sequence[dataclasses.Field[Any]]) -> None:
    """Refuses the flags of these fields, since another flag is missing.

    Raises:
        TaskError: There are such flags.
    """
    if fields:
        from tdac_envs.core.errors import TaskError

        verb = "needs" if len(fields) == 1 else "need"
        raise TaskError(f"{', '.join(map(flag_name, fields))} {verb} {needed}")
