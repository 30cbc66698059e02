"""The end of a drive: zero, several times, whatever signals arrive."""

from __future__ import annotations

from collections.abc import Callable
import signal
import time
from typing import Any

ZEROS = 7
"""How often the last command is sent."""
ENDS = [
    getattr(signal, name) for name in ('SIGINT', 'SIGTERM', 'SIGHUP') if hasattr(signal, name)]
"""Signals that end the node; SIGHUP comes when its terminal is closed, or ssh is lost."""


def take_signals() -> None:
    """
    Let the first of `ENDS` raise KeyboardInterrupt, and ignore further ones.

    SIGHUP stays ignored under nohup.
    """
    for number in ENDS:
        is_kept = number not in (signal.SIGINT, signal.SIGTERM)
        if not is_kept or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, _interrupt)


def ignore_signals() -> None:
    """Ignore the signals of `ENDS` from now on."""
    for number in ENDS:
        signal.signal(number, signal.SIG_IGN)


def is_told() -> bool:
    """
    Return whether a signal of `ENDS` came, so that the node must end.

    Python drops a KeyboardInterrupt that is raised in a destructor, such as that of a future of
    rclpy.
    """
    return signal.getsignal(signal.SIGTERM) == signal.SIG_IGN


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
