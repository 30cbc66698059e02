"""Run a node with rclpy until it is told to end; its last commands are zero."""

from __future__ import annotations

from collections.abc import Callable
import sys
from typing import Any, Protocol

import rclpy
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from . import ending

WAKES = 0.1
"""Longest time in which a signal waits for its handler, s of the wall clock."""


class Ended(Protocol):
    """A node of rclpy that sends the last commands itself."""

    def send_last(self, reason: str) -> None:
        """Send the last commands, which are zero; `reason` says why the node ends."""

    def destroy_node(self) -> None:
        """Destroy the node, as those of rclpy do."""


def run(name: str, make: Callable[[], Ended], args: Any = None) -> None:
    """
    Run a node until the process is told to end; the last commands are zero.

    Args:
        name: What the message of an error begins with.
        make: Makes the node, once rclpy is initialised.
        args: The command line; None for that of the process.

    Raises SystemExit(2), after one line on stderr, if a parameter, a name or a file is wrong.
    """
    ending.take_signals()
    node, reason = None, 'the node failed'
    try:
        _begin(args)
        node = make()
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        while rclpy.ok() and not ending.is_told():  # a paused clock must not delay this
            executor.spin_once(timeout_sec=WAKES)
        reason = 'the node was told to end'
    except KeyboardInterrupt:
        reason = 'the node was told to end'
    except (NameValidationException, OSError, ParameterException, ValueError) as error:
        said = ' '.join(each.strip() for each in str(error).splitlines()[:2])
        print(f'{name}: {said}', file=sys.stderr)
        raise SystemExit(2) from None
    finally:
        ending.ignore_signals()
        if node is not None:
            node.send_last(reason)
            node.destroy_node()
        rclpy.try_shutdown()


def _begin(args: Any) -> None:
    """Initialise rclpy; ValueError says what is wrong with the command line or its files."""
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # its own class is private
        raise ValueError(str(error).split(', at ')[0]) from None
