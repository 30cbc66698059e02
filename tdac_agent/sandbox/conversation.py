"""Exchange requests and answers with one child; turn failures into typed errors."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from tdac_agent.sandbox.channel import (
    Channel,
    ChannelClosedError,
    Deadline,
    DeadlineError,
    FrameError,
    OutputFloodError,
    StarvedError,
)
from tdac_agent.sandbox.ending import ChildUsage, has_ended
from tdac_agent.sandbox.errors import (
    ControllerDied,
    ControllerOutputFlood,
    ControllerProtocolError,
    ControllerTimeout,
    MachineBusyError,
    SandboxError,
)
from tdac_agent.sandbox.explain import controller_error, explain_end
from tdac_agent.sandbox.inner.decode import decode
from tdac_agent.sandbox.inner.encode import encode
from tdac_agent.sandbox.inner.layout import Layout
from tdac_agent.sandbox.inner.wire import Kind, RemoteError, WireError
from tdac_agent.sandbox.limits import Limits
from tdac_agent.sandbox.time_limit import limit_of_answer
from tdac_agent.sandbox.waiting import RunQueue

EXIT_SECONDS = 1.0
_FAILURES = (
    ChannelClosedError,
    DeadlineError,
    FrameError,
    OutputFloodError,
    StarvedError,
)


class Conversation:
    """Runs the protocol over a channel, and ends the child at the first violation.

    Args:
        channel: Transports the frames.
        process: The controller's process, whose time is limited.
        lifeline: Descriptor that shows when the child has ended.
        limits: Resource limits of the child.
        root: Private folder, whose path is removed from messages.
        end: Kills the child and returns its resource usage.
    """

    def __init__(
        self,
        channel: Channel,
        process: RunQueue,
        lifeline: int,
        limits: Limits,
        root: Path,
        end: Callable[[], ChildUsage],
    ) -> None:
        self._channel, self._process = channel, process
        self._lifeline = lifeline
        self._limits = limits
        self._root = root
        self._end = end
        self._sequence = 0
        self._fault: Exception | None = None
        self._layout: Layout | None = None

    def request(self, kind: Kind, value: Any, phase: str, seconds: float) -> Any:
        """Return the child's answer to one request."""
        deadline = limit_of_answer(seconds, self._process)
        self.send(kind, value, phase, deadline, seconds)
        answer, result = self.receive(phase, deadline, seconds)
        if answer != Kind.VALUE:
            self.breach("an unexpected answer", phase)
        return result

    def send(
        self, kind: Kind, value: Any, phase: str, deadline: Deadline, seconds: float
    ) -> None:
        """Send one frame."""
        if self._fault is not None:
            raise self._fault.with_traceback(None)
        self._sequence = (self._sequence + 1) & 0xFFFFFFFF
        payload = self._payload(kind, value)
        try:
            self._channel.send(kind, self._sequence, payload, deadline)
        except _FAILURES as e:
            self._fail(e, phase, seconds)

    def _payload(self, kind: Kind, value: Any) -> bytes:
        """Return the encoded value; observations, which are frequent, use a layout."""
        if kind != Kind.POLICY or type(value) is not dict:
            return encode(value)
        payload = None if self._layout is None else self._layout.encode(value)
        if payload is None:
            self._layout = Layout.of(value)
            payload = encode(value)
        return payload

    def receive(
        self, phase: str, deadline: Deadline, seconds: float
    ) -> tuple[int, Any]:
        """Return kind and value of the answer to the last frame that was sent."""
        try:
            kind, sequence, payload = self._channel.receive(deadline)
            value = decode(payload)
        except _FAILURES as e:
            self._fail(e, phase, seconds)
        except WireError as error:
            self.breach(str(error), phase)
        if sequence != self._sequence:
            self.breach("an answer to another request", phase)
        if kind == Kind.ERROR:
            if type(value) is not RemoteError:
                self.breach("a malformed error", phase)
            raise controller_error(value, phase, self._root)
        return kind, value

    def breach(self, what: str, phase: str) -> NoReturn:
        """End the child because it sent something that our server never sends."""
        message = f"misused the judge's channel at {phase}: {what}"
        self.give_up(ControllerProtocolError(message, phase))

    def stop(self) -> ChildUsage:
        """End the child; further requests raise its fault again, or `SandboxError`."""
        self._fault = self._fault or SandboxError("the child has ended")
        return self._end()

    def give_up(self, fault: Exception) -> NoReturn:
        """End the child and raise `fault`, now and at each further request."""
        self._fault = fault
        self._end()
        raise fault

    def _fail(self, error: Exception, phase: str, seconds: float) -> NoReturn:
        if isinstance(error, DeadlineError):
            self.give_up(ControllerTimeout(phase, seconds, busy=error.busy))
        if isinstance(error, StarvedError):
            self.give_up(MachineBusyError(phase, seconds))
        if isinstance(error, FrameError):
            self.breach(str(error), phase)
        if isinstance(error, OutputFloodError):
            text = f"printed more than {self._limits.output_bytes} bytes at {phase}"
            self.give_up(ControllerOutputFlood(text, phase))
        if not has_ended(self._lifeline, EXIT_SECONDS):
            self.breach("closed it", phase)
        used, limit = self._end(), self._limits.cpu_seconds
        text = explain_end(used.status, phase, used.cpu_seconds, limit)
        self.give_up(ControllerDied(text, phase, used.status))
