"""What can go wrong with a child: the controller's doing, or ours."""

from __future__ import annotations

from typing import Any


class SandboxError(Exception):
    """The sandbox itself failed; says nothing about the controller."""


class ControllerFault(Exception):
    """The controller did something that a verdict counts as failed.

    Args:
        message: One sentence that a user can read.
        phase: What the controller was doing: "import", "reset", "policy", ...

    Attributes:
        may_pass: Whether it may have been the machine's doing, and is worth a retry.
    """

    may_pass = False

    def __init__(self, message: str, phase: str) -> None:
        super().__init__(message)
        self.phase = phase

    def __reduce__(self) -> tuple[Any, ...]:
        return _revive, (type(self), self.args, self.__dict__)


def _revive(
    kind: type[ControllerFault], arguments: tuple[Any, ...], state: dict[str, Any]
) -> ControllerFault:
    """Rebuild a fault that a worker process has sent."""
    fault = kind.__new__(kind, *arguments)
    fault.__dict__.update(state)
    return fault


class ControllerError(ControllerFault):
    """An exception was raised in the controller; the child still answers.

    Args:
        type_name: Class of the exception.
        text: Its message, bounded, without paths and addresses.
        line: Line of `controller.py`, 0 where unknown.
        traceback: The controller's own lines, outermost first.
        phase: What the controller was doing.
    """

    def __init__(
        self, type_name: str, text: str, line: int, traceback: str, phase: str
    ) -> None:
        where = f" (line {line})" if line else ""
        tail = f": {text}" if text else ""
        super().__init__(f"{type_name} at {phase}{where}{tail}", phase)
        self.type_name = type_name
        self.text = text
        self.line = line
        self.traceback = traceback


class ControllerTimeout(ControllerFault):
    """The controller did not answer in time.

    Args:
        phase: What the controller was doing.
        seconds: How long it was given.
        busy: Whether it was on a CPU all that time; else it may have been kept
            waiting for something.
    """

    def __init__(self, phase: str, seconds: float, *, busy: bool = False) -> None:
        super().__init__(f"{phase} did not end within {seconds:g} s", phase)
        self.seconds = seconds
        self.may_pass = not busy


class ControllerDied(ControllerFault):
    """The controller's process ended.

    Args:
        message: How it ended.
        phase: What the controller was doing.
        status: Exit code, or minus the number of the signal.
    """

    def __init__(self, message: str, phase: str, status: int) -> None:
        super().__init__(message, phase)
        self.status = status


class ControllerProtocolError(ControllerFault):
    """The controller wrote something of its own to the channel."""


class ControllerOutputFlood(ControllerFault):
    """The controller printed more than it may."""


class EnvRefusalError(Exception):
    """An env refuses what a controller asked; the controller sees a RuntimeError."""
