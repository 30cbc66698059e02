"""Describe a child's failure in one sentence."""

from __future__ import annotations

import re
import signal
from pathlib import Path

from tdac_agent.sandbox.errors import ControllerError
from tdac_agent.sandbox.inner.wire import RemoteError
from tdac_agent.storage.plain import printable

MAX_TEXT = 2000
_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+|0x[0-9a-fA-F]{6,}")


def controller_error(error: RemoteError, phase: str, root: Path) -> ControllerError:
    """Return the exception for an error frame, with texts made safe to print."""
    return ControllerError(
        clean(error.type_name, root)[:200],
        clean(error.message, root),
        error.line,
        clean(error.traceback, root),
        phase,
    )


def clean(text: str, root: Path) -> str:
    """Return `text` without private paths, addresses and unprintable characters."""
    text = text[: 4 * MAX_TEXT].replace(f"{root / 'work'}/", "").replace(f"{root}/", "")
    return printable(_ADDRESS.sub("", text))[:MAX_TEXT]


def explain_end(status: int, phase: str, cpu_seconds: float, cpu_limit: float) -> str:
    """Describe how a child ended.

    Args:
        status: Exit code, or minus the number of the signal.
        phase: What the controller was doing.
        cpu_seconds: CPU time that it used.
        cpu_limit: Limit of its CPU time, s.
    """
    if status >= 0:
        return f"ended its own process with exit code {status} at {phase}"
    number = -status
    if number == signal.SIGXCPU or cpu_seconds >= cpu_limit:
        return f"killed at {phase}: used more than {cpu_limit} s of CPU time"
    if number == signal.SIGSYS:
        return f"killed at {phase} by SIGSYS: a forbidden system call"
    if number == signal.SIGKILL:
        return f"killed at {phase} by SIGKILL, possibly because memory ran out"
    return f"crashed at {phase} with {_signal_name(number)}"


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
