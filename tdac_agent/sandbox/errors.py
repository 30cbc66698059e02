"""Errors of a child: faults of the controller and failures of the sandbox."""

from __future__ import annotations

from typing import Any


class SandboxError(Exception):
    """The sandbox itself failed; this says nothing about the controller."""

    @property
    def fault(self) -> str:
        """The message for a user."""
        return f"the sandbox failed: {self}"


class MachineBusyError(SandboxError):
    """A controller waited for a CPU for longer than anybody should wait for it.

    Args:
        phase: What the controller was doing.
        seconds: Time that it may compute, and sleep, s.
    """

    def __init__(self, phase: str, seconds: float) -> None:
        super().__init__(
            f"the machine is too busy: {phase} did not get the {seconds:g} s of CPU "
            "time that it may use; try again when a core is free"
        )

    @property
    def fault(self) -> str:
        """The message for a user; the sandbox itself is sound."""
        return str(self)


class ControllerFault(Exception):
    """A fault of the controller, which a verdict counts as failed.

    Args:
        message: One sentence for the user.
        phase: What the controller was doing: "import", "reset", "policy", ...

    Attributes:
        is_retryable: Whether the machine may have caused it, so that a retry may pass.
    """

    is_retryable = False

    def __init__(self, message: str, phase: str) -> None:
        super().__init__(message)
        self.phase = phase

    def __reduce__(self) -> tuple[Any, ...]:
        return _revive, (type(self), self.args, self.__dict__)


def _revive(
    kind: type[ControllerFault], arguments: tuple[Any, ...], state: dict[str, Any]
) -> ControllerFault:
    """Rebuild a fault that a worker process sent."""
    fault = kind.__new__(kind, *arguments)
    fault.__dict__.update(state)
    return fault


class ControllerError(ControllerFault):
    """The controller raised an exception; the child keeps running.

    Args:
        type_name: Class of the exception.
        text: Its message, truncated, without paths and memory addresses.
        line: Line of `controller.py`, 0 if unknown.
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
        seconds: Time limit.
        busy: Whether it was on a CPU nearly all that time; if not, it may have been
            waiting for something.
    """

    def __init__(self, phase: str, seconds: float, *, busy: bool = False) -> None:
        super().__init__(f"{phase} did not end within {seconds:g} s", phase)
        self.seconds, self.busy = seconds, busy
        self.is_retryable = not busy


class ControllerOverdrawn(ControllerTimeout):
    """The controller used more CPU time than its budget.

    Args:
        phase: What the controller was doing.
        used: CPU time that it used, s.
        allowed: CPU time that it was allowed, s.
        what: What the time was for.
    """

    def __init__(self, phase: str, used: float, allowed: float, what: str) -> None:
        text = f"used {used:.2f} s of CPU time for {what}; {allowed:.2f} s are allowed"
        ControllerFault.__init__(self, text, phase)
        self.seconds, self.busy = allowed, True
        self.is_retryable = used <= 2.0 * allowed


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
    """The controller itself wrote to the judge's channel or closed it."""


class ControllerOutputFlood(ControllerFault):
    """The controller printed more than the limit."""


class EnvRefusalError(Exception):
    """An env refuses a controller's request; the controller gets a RuntimeError."""
