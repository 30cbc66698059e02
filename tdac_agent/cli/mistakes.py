"""Lines on stderr: errors with their exit codes, and a note while a command loads."""

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
    from tdac_envs.core.errors import PicturedError

from tdac_agent.cli.terminal import unfiltered

LONGEST_LINE = 1000
# The file or its name is wrong on every machine: a usage error.
_WRONG_FILE = {errno.ENAMETOOLONG, errno.ELOOP, errno.EINVAL, errno.EFBIG}


def explain(error: Exception) -> NoReturn:
    """Ends the process with a one-line message; only a bug gets a traceback."""
    from tdac_agent.errors import Fault
    from tdac_envs.core.errors import MAX_QUOTED, PicturedError, TdacError

    if hasattr(error, "format_message"):  # a usage error found by typer
        _explain_usage(error)
    if isinstance(error, PicturedError):
        fail(f"error: {error}{_write_pictures(error)}", 2)
    if isinstance(error, TdacError):
        *others, last = getattr(error, "lines", (str(error),))
        for line in others:
            print(fitted(f"error: {line}"), file=sys.stderr)
        fail(f"error: {last}", 2)
    if isinstance(error, Fault):
        fail(f"infrastructure fault: {error}", 3)
    if isinstance(error, OSError) and error.filename:
        code = 2 if error.errno in _WRONG_FILE else 3
        fail(f"error: {str(error.filename)[:MAX_QUOTED]}: {error.strerror}", code)
    traceback.print_exception(error)
    fail("internal error: please report the lines above", 3)


def _write_pictures(error: PicturedError) -> str:
    """Draws why a map is refused; returns where, or nothing if that fails."""
    from tdac_envs.core.errors import MapError
    from tdac_envs.mapping.map_folder import write_pictures

    try:
        files = write_pictures(error)
    except MapError:
        return ""
    return f"; look at {' and '.join(map(str, files))}"


def fail(message: str, code: int) -> NoReturn:
    """Ends the process with a line on stderr; cuts the middle of a long line."""
    sys.stdout.flush()
    line = " ".join(message.split())
    if len(line) > LONGEST_LINE:
        line = f"{line[:600]} … {line[-300:]}"
    print(fitted(line), file=sys.stderr)
    sys.exit(code)


@contextmanager
def begun() -> Generator[None]:
    """Shows `starting …` on a terminal while a command's imports take seconds."""
    terminal = unfiltered(sys.stderr)
    is_terminal = terminal.isatty()
    if is_terminal:
        print("starting …", end="\r", file=terminal, flush=True)
    try:
        yield
    finally:
        if is_terminal:
            print("\x1b[2K", end="", file=terminal, flush=True)


def fitted(line: str) -> str:
    """The line for stderr; wrapped to the width of a terminal, unchanged elsewhere."""
    if not sys.stderr.isatty():
        return line
    return folded(line, shutil.get_terminal_size().columns)


def folded(line: str, width: int, hanging: int = 2) -> str:
    """Wraps a line with a hanging indent; does not break words or paths."""
    return textwrap.fill(
        line,
        width,
        subsequent_indent=" " * hanging,
        break_long_words=False,
        break_on_hyphens=False,
    )


def _explain_usage(error: Any) -> NoReturn:
    """Prints a usage error and names the command whose help to read."""
    context = getattr(error, "ctx", None)
    option = getattr(error, "option_name", None)
    message = _typed_value(error) or error.format_message()
    reason = message.rstrip(".").replace("Value error, ", "")
    # Without arguments, typer has already printed the help.
    if not reason:
        sys.exit(2)
    if option is not None and hasattr(error, "possibilities") and context is not None:
        meant = _nearest(option, [o for p in context.command.params for o in p.opts])
        reason = error.message + (f"; did you mean {meant}?" if meant else "")
    command = "tdac" if context is None else context.command_path
    fail(f"error: {reason}; see {command} --help", 2)


def _typed_value(error: Any) -> str:
    """Names the option, and the value that was typed for it; empty if unknown."""
    details = getattr(error.__cause__, "errors", None)
    option = getattr(error, "param", None)
    if not callable(details) or option is None:
        return ""
    [problem, *_] = details()
    kinds = {"float_parsing": "a number", "int_parsing": "a whole number"}
    value, kind = problem["input"], kinds.get(problem["type"])
    if kind is None:
        return "" if str(value) in error.message else f"{_got(error)}, got {value}"
    name = max(option.opts, key=len)
    return f"{name} {value}: expected {kind}"


def _got(error: Any) -> str:
    return str(error.format_message()).rstrip(".").replace("Input should", "it must")


def _nearest(typed: str, options: list[str]) -> str | None:
    """The most similar option, compared without case and leading dashes."""
    from tdac_envs.core.errors import nearest

    bare = {option.lstrip("-").lower(): option for option in options}
    meant = nearest(typed.lstrip("-").lower(), bare)
    return bare[meant] if meant else None
