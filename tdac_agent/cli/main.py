"""The command line: `tdac map | world | synth | verify | play | evaluate | …`.

Exit codes: 0 yes, 1 no (not verified), 2 usage or infeasible task, 3 infrastructure,
4 budget, 130 interrupted.
"""

from __future__ import annotations

import gc
import logging
import os
import signal
import sys
from collections.abc import Callable
from copy import copy
from typing import Annotated, Any

import typer

from tdac_agent.cli import (
    campaign_flags,
    check_suite_flags,
    doctor_flags,
    evaluate_flags,
    map_flags,
    play_flags,
    runs_flags,
    synth_flags,
    train_flags,
    verify_flags,
    webots_flags,
)
from tdac_agent.cli.mistakes import explain, fail
from tdac_agent.cli.terminal import filter_streams

app = typer.Typer(
    name="tdac",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help=(
        "Write a robot controller from tests, and know that it works.\n\n"
        "Start with `tdac synth`: it turns the bundled maze image into a verified "
        "`controller.py`, with no key and no network."
    ),
)
# Each module has the flags of its commands and calls on their work when they are used:
# the help of all of them needs nothing else. They are listed in this order.
PARTS = (
    map_flags.app,
    synth_flags.app,
    verify_flags.app,
    play_flags.app,
    evaluate_flags.app,
    train_flags.app,
    campaign_flags.app,
    check_suite_flags.app,
    runs_flags.app,
    webots_flags.app,
    doctor_flags.app,
)
FOR_HELP = frozenset(["-h", "--help"])


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
    """The commands, or the part of them that has the first word alone.

    Typer reads the flags of all that it is given, and takes its time. The list of all
    commands shows none.
    """
    line, first = copy(app), set(words[:1])
    line.registered_groups = []
    for part in [part for part in PARTS if first & _names(part)] or PARTS:
        line.add_typer(part if first - FOR_HELP else _without_flags(part))
    return line


def _without_flags(part: typer.Typer) -> typer.Typer:
    """The same commands and groups, to be listed only."""
    listed = copy(part)
    listed.registered_commands = [copy(info) for info in part.registered_commands]
    for info in listed.registered_commands:
        info.callback = _nothing_like(info.callback)
    listed.registered_groups = [copy(info) for info in part.registered_groups]
    for group in listed.registered_groups:
        assert group.typer_instance is not None
        group.typer_instance = _without_flags(group.typer_instance)
    return listed


def _nothing_like(command: Callable[..., Any] | None) -> Callable[[], None]:
    """Has its name and its help."""

    def nothing() -> None:
        pass

    nothing.__name__ = getattr(command, "__name__", "")
    nothing.__doc__ = command.__doc__
    return nothing


def _names(part: typer.Typer) -> set[str | None]:
    """Of the commands and groups of a part."""
    commands = {
        command.name or command.callback.__name__.replace("_", "-")
        for command in part.registered_commands
        if command.callback is not None
    }
    return commands | {group.name for group in part.registered_groups}


def with_heading(words: list[str]) -> list[str]:
    """A command line in which `--start X Y YAW` is `--start X Y --heading YAW`."""
    for at, word in enumerate(words):
        pose = words[at + 1 : at + 4]
        if word == "--start" and len(pose) == 3 and all(map(_is_number, pose)):
            return [*words[: at + 3], "--heading", *with_heading(words[at + 3 :])]
    return words


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def main() -> None:
    """Does what the command line says: every known error is one clear line."""
    filter_streams()
    # Its threads would keep a core busy, waiting for work that nothing here has.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # To look for some, pydantic reads what every installed package says of itself.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    # It writes names of files to stderr itself, past every filter.
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    # It says at length where it keeps its fonts if it cannot write to a home.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.default_int_handler)
    try:
        words = sys.argv[1:]
        words = words if words[:1] == ["map"] else with_heading(words)
        code = command_line(words)(words, prog_name="tdac", standalone_mode=False)
    except (KeyboardInterrupt, typer.Abort):
        code = 130
    except Exception as error:
        explain(error)
    if code == 130:
        fail("interrupted", 130)
    # A last search for garbage would take longer than much of the rest.
    gc.freeze()
    sys.exit(code or 0)
