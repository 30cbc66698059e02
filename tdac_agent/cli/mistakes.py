"""Lines on stderr: what goes wrong, with its exit code, and that a command begins."""

from __future__ import annotations

import errno
import shutil
import sys
import textwrap
import traceback
from collections.abc import Generator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NoReturn

if TYPE_CHECKING:
    from tdac_envs.core.errors import PolarityError

from tdac_agent.cli.terminal import unfiltered

LONGEST_LINE = 1000
# No machine would take such a name or such a file.
_OF_THE_FILE = {errno.ENAMETOOLONG, errno.ELOOP, errno.EINVAL, errno.EFBIG}


def explain(error: Exception) -> NoReturn:
    """Ends the process with one line on what was wrong; a traceback only for a bug."""
    from tdac_agent.errors import Fault
    from tdac_envs.core.errors import LONGEST, PolarityError, TdacError

    if hasattr(error, "format_message"):  # usage, as typer found it
        _explain_usage(error)
    if isinstance(error, PolarityError):
        fail(f"error: {error}{_shown(error)}", 2)
    if isinstance(error, TdacError):
        *others, last = getattr(error, "lines", (str(error),))
        for line in others:
            print(fitted(f"error: {line}"), file=sys.stderr)
        fail(f"error: {last}", 2)
    if isinstance(error, Fault):
        fail(f"infrastructure fault: {error}", 3)
    if isinstance(error, OSError) and error.filename:
        code = 2 if error.errno in _OF_THE_FILE else 3
        fail(f"error: {str(error.filename)[:LONGEST]}: {error.strerror}", code)
    traceback.print_exception(error)
    fail("internal error: please report the lines above", 3)


def _shown(error: PolarityError) -> str:
    """Draws both readings of a map; says where, or nothing where that fails."""
    from tdac_envs.core.errors import MapError
    from tdac_envs.mapping.map_folder import write_previews

    try:
        files = write_previews(error)
    except MapError:
        return ""
    return f"; look at {' and '.join(map(str, files))}"


def fail(message: str, code: int) -> NoReturn:
    """Ends the process with a line on stderr."""
    sys.stdout.flush()
    line = " ".join(message.split())
    if len(line) > LONGEST_LINE:  # of what it quotes the beginning is enough
        line = f"{line[:600]} … {line[-300:]}"
    print(fitted(line), file=sys.stderr)
    sys.exit(code)


@contextmanager
def begun() -> Generator[None]:
    """Shows on a terminal that a command loads what it needs: that may take seconds."""
    terminal = unfiltered(sys.stderr)
    shown = terminal.isatty()
    if shown:
        print("starting …", end="\r", file=terminal, flush=True)
    try:
        yield
    finally:
        if shown:
            print("\x1b[2K", end="", file=terminal, flush=True)


def fitted(line: str) -> str:
    """A line for stderr; a terminal gets it in its width, no word or path broken."""
    if not sys.stderr.isatty():
        return line
    return folded(line, shutil.get_terminal_size().columns)


def folded(line: str, width: int, hanging: int = 2) -> str:
    """A line in a width, what goes on indented; no word or path is broken."""
    return textwrap.fill(
        line,
        width,
        subsequent_indent=" " * hanging,
        break_long_words=False,
        break_on_hyphens=False,
    )


def _explain_usage(error: Any) -> NoReturn:
    """What is wrong with the words typed, and whose help says more."""
    context = getattr(error, "ctx", None)
    option = getattr(error, "option_name", None)
    # typer says of a choice what pydantic says of a value.
    reason = error.format_message().rstrip(".").replace("Value error, ", "")
    # Without any word there is help, and nothing more to say.
    if not reason:
        sys.exit(2)
    if option is not None and hasattr(error, "possibilities") and context is not None:
        near = _nearest(option, [o for p in context.command.params for o in p.opts])
        reason = error.message + (f"; did you mean {near}?" if near else "")
    command = "tdac" if context is None else context.command_path
    fail(f"error: {reason}; see {command} --help", 2)


def _nearest(typed: str, options: list[str]) -> str | None:
    """The option that may be meant, whatever its case and number of dashes."""
    from tdac_envs.core.errors import nearest

    bare = {option.lstrip("-").lower(): option for option in options}
    found = nearest(typed.lstrip("-").lower(), bare)
    return bare[found] if found else None
