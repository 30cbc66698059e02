"""The end of a drive: zero, several times, whatever signals arrive."""

from __future__ import annotations

from collections.abc import Callable
import signal
import time
from typing import Any

ZEROS = 7
"""How often the last command is sent."""


def take_signals() -> None:
    """Let the first SIGINT or SIGTERM raise KeyboardInterrupt, and ignore further ones."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _interrupt)


def ignore_signals() -> None:
    """Ignore SIGINT and SIGTERM from now on."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


def send_last(publish: Callable[[Any], None], command: Any, lasts: float) -> None:
    """
    Publish the last command `ZEROS` times, spread over some seconds of the wall clock.

    A single message can be lost, and one that is sent just before the process ends may
    never leave it.

    Args:
        publish: Publishes a command.
        command: The command, which is zero.
        lasts: Time from the first to the last message.
    """
    for i in range(ZEROS):
        if i:
            time.sleep(lasts / (ZEROS - 1))
        publish(command)


def _interrupt(_number: int, _frame: Any) -> None:
    ignore_signals()
    raise KeyboardInterrupt
