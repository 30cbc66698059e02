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
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperArgument, TyperCommand, TyperGroup

from tdac_agent.cli.coordinates import with_coordinates
from tdac_agent.cli.mistakes import explain, fail
from tdac_agent.cli.terminal import filter_streams

FOR_HELP = frozenset(["-h", "--help"])
DEFAULTS = ("run", "show")
COMPLETE, ZSH = "_TDAC_COMPLETE", "_TYPER_COMPLETE_ARGS"
"""Variables of a shell that asks how to complete a command line."""


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
    add_completion=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help=(
        "Write a robot controller and verify it with tests.\n\n"
        "Start with `tdac synth`: it writes a verified `controller.py` for the bundled "
        "maze, without an API key or a network."
    ),
)
PARTS = {
    "map_flags": ("map", "world"),
    "synth_flags": ("synth",),
    "mcp_flags": ("mcp",),
    "verify_flags": ("verify",),
    "play_flags": ("play",),
    "falsify_flags": ("falsify",),
    "evaluate_flags": ("evaluate",),
    "bench_flags": ("bench",),
    "train_flags": ("train",),
    "campaign_flags": ("campaign",),
    "check_suite_flags": ("check-suite",),
    "sets_flags": ("sets",),
    "robots_flags": ("robots",),
    "studio_flags": ("studio",),
    "runs_flags": ("demo", "report", "runs", "rules"),
    "webots_flags": ("webots", "export"),
    "ros_flags": ("ros",),
    "doctor_flags": ("doctor", "warm"),
}
"""Modules with the flags of commands, in the order of `tdac --help`, and their names.

They import a command's work when it runs, so that help is fast.
"""


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
    """The app, reduced to what the words need, since flags are slow to read.

    It has only the command that is the first word; for `tdac --help` it has all
    commands, without their flags.
    """
    line, first = copy(app), set(words[:1])
    line.registered_groups = []
    for part in [name for name, own in PARTS.items() if first & {*own}] or PARTS:
        typed: typer.Typer = import_module(f"tdac_agent.cli.{part}").app
        line.add_typer(_copy_of(typed, with_flags=bool(first - FOR_HELP)))
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


def _completed() -> list[str]:
    """The words so far, if a shell asks how to complete them; else none."""
    if COMPLETE not in os.environ:
        return []
    return os.environ.get("COMP_WORDS", os.environ.get(ZSH, "")).split()[1:]


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
        words = with_coordinates(sys.argv[1:])
        line = command_line(_completed() or words)
        code = line(words, prog_name="tdac", standalone_mode=False)
    except (KeyboardInterrupt, typer.Abort):
        code = 130
    except Exception as error:
        explain(error)
    if code == 130:
        fail("interrupted", 130)
    # Skips the final garbage collection, which is slow.
    gc.freeze()
    sys.exit(code or 0)
