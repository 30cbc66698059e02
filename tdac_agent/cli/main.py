"""The command line: `tdac map | world | synth | verify | play | evaluate | bench | …`.

Exit codes: 0 success, 1 not verified, 2 usage or infeasible task, 3 infrastructure,
4 budget exhausted, 130 interrupted.
"""

from __future__ import annotations

import gc
import logging
import os
import signal
import sys
from collections.abc import Callable
from copy import copy
from functools import partial
from typing import Annotated, Any

import typer
from typer.core import TyperArgument, TyperCommand, TyperGroup

from tdac_agent.cli import (
    bench_flags,
    campaign_flags,
    check_suite_flags,
    doctor_flags,
    evaluate_flags,
    map_flags,
    mcp_flags,
    play_flags,
    runs_flags,
    sets_flags,
    studio_flags,
    synth_flags,
    train_flags,
    verify_flags,
    webots_flags,
)
from tdac_agent.cli.mistakes import explain, fail
from tdac_agent.cli.places import with_places
from tdac_agent.cli.terminal import filter_streams

FOR_HELP = frozenset(["-h", "--help"])
DEFAULTS = ("run", "show")


class _Command(TyperCommand):
    def get_params(self, ctx: Any) -> list[Any]:
        return _without_types(super().get_params(ctx))


class _Group(TyperGroup):
    """A group; its command `run`, or else `show`, may be left out.

    Not of a group that does something by itself, such as `tdac sets`.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        default = [name for name in DEFAULTS if name in self.commands][:1]
        if self.invoke_without_command:
            default = []
        if default and args and args[0] not in self.commands:
            args = [*default, *args]
        return list(super().parse_args(ctx, args))

    def get_params(self, ctx: Any) -> list[Any]:
        return _without_types(super().get_params(ctx))


def _without_types(parameters: list[Any]) -> list[Any]:
    """The parameters, with capital names of arguments and no needless types."""
    for parameter in parameters:
        is_argument = isinstance(parameter, TyperArgument)
        if is_argument:
            parameter.metavar = parameter.metavar or parameter.name.upper()
            parameter.get_usage_pieces = partial(_usage, parameter)
        if is_argument or parameter.is_bool_flag:
            parameter.display_type_rich = lambda **_: ""
    return parameters


def _usage(argument: Any, _context: Any) -> list[str]:
    """An argument in the usage line; Typer would write `{POLICY...}...`."""
    name = argument.metavar.removesuffix("...")
    name = name if argument.required else f"[{name}]"
    return [name if argument.nargs == 1 else f"{name}..."]


app = typer.Typer(
    name="tdac",
    cls=_Group,
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help=(
        "Write a robot controller and verify it with tests.\n\n"
        "Start with `tdac synth`: it writes a verified `controller.py` for the bundled "
        "maze, without an API key or a network."
    ),
)
# In the order of `tdac --help`. These modules define flags only and import a command's
# work when it runs, so that help is fast.
PARTS = (
    map_flags.app,
    synth_flags.app,
    mcp_flags.app,
    verify_flags.app,
    play_flags.app,
    evaluate_flags.app,
    bench_flags.app,
    train_flags.app,
    campaign_flags.app,
    check_suite_flags.app,
    sets_flags.app,
    studio_flags.app,
    runs_flags.app,
    webots_flags.app,
    doctor_flags.app,
)


@app.callback(invoke_without_command=True)
def _root(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and exit.")
    ] = False,
) -> None:
    if version:
        from importlib.metadata import version as installed

        typer.echo(f"tdac {installed('tdac')}")
        raise typer.Exit


def command_line(words: list[str]) -> typer.Typer:
    """The app, reduced to what the words need, since Typer is slow to read flags.

    It has only the command that is the first word; for `tdac --help` it has all
    commands, without their flags.
    """
    line, first = copy(app), set(words[:1])
    line.registered_groups = []
    for part in [part for part in PARTS if first & _names(part)] or PARTS:
        line.add_typer(_copy_of(part, with_flags=bool(first - FOR_HELP)))
    return line


def _copy_of(part: typer.Typer, *, with_flags: bool) -> typer.Typer:
    """The same commands and groups; without flags, they can only be listed."""
    made = copy(part)
    made.registered_commands = [copy(info) for info in part.registered_commands]
    for info in made.registered_commands:
        info.cls = _Command
        if not with_flags:
            info.callback = _without_flags(info.callback)
    made.registered_groups = [copy(info) for info in part.registered_groups]
    for group in made.registered_groups:
        assert group.typer_instance is not None
        group.cls = _Group
        group.typer_instance = _copy_of(group.typer_instance, with_flags=with_flags)
    return made


def _without_flags(command: Callable[..., Any] | None) -> Callable[[], None]:
    """A function without parameters that has the command's name and help."""

    def nothing() -> None:
        pass

    nothing.__name__ = getattr(command, "__name__", "")
    nothing.__doc__ = command.__doc__
    return nothing


def _names(part: typer.Typer) -> set[str | None]:
    """Names of the commands and groups of a part."""
    commands = {
        command.name or command.callback.__name__.replace("_", "-")
        for command in part.registered_commands
        if command.callback is not None
    }
    return commands | {group.name for group in part.registered_groups}


def main() -> None:
    """Runs the command line; every known error is one line on stderr."""
    filter_streams()
    # Idle OpenBLAS threads would keep a core busy.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # To find plugins, pydantic would read the metadata of every installed package.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    # OpenCV would write unfiltered file names to stderr.
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    # Matplotlib warns about its font cache if the home is not writable.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.default_int_handler)
    try:
        words = with_places(sys.argv[1:])
        code = command_line(words)(words, prog_name="tdac", standalone_mode=False)
    except (KeyboardInterrupt, typer.Abort):
        code = 130
    except Exception as error:
        explain(error)
    if code == 130:
        fail("interrupted", 130)
    # Skips the final garbage collection, which is slow.
    gc.freeze()
    sys.exit(code or 0)
