"""The judge's end of the channel: frames with deadlines, and the printed output."""

from __future__ import annotations

import contextlib
import math
import os
import select
import time
from collections.abc import Callable

from tdac_agent.sandbox.inner.wire import HEADER

CHUNK = 1 << 16
# Most answers are short, and a large buffer costs more than the whole round trip.
SHORT = 1 << 12
KEPT_OUTPUT = 4000
# A pipe holds 64 kB, which is read in so many pieces.
MOST_LATE_READS = 1 + (1 << 16) // SHORT

Deadline = Callable[[], float]
"""Returns the seconds left; may raise `DeadlineError` or `StarvedError`."""


class ChannelClosedError(Exception):
    """The child closed its end of the channel, most likely by exiting."""


class DeadlineError(Exception):
    """The deadline passed before a whole frame was sent or received.

    Args:
        busy: Whether the child used up its time by computing.
    """

    def __init__(self, *, busy: bool) -> None:
        super().__init__()
        self.busy = busy


class StarvedError(Exception):
    """The child is still in time, but the machine gave it too little of a CPU."""


class FrameError(Exception):
    """The child sent bytes that are not the expected frame."""


class OutputFloodError(Exception):
    """The child printed more than the limit."""


class Channel:
    """Sends requests, receives answers, keeps the head and tail of the printed output.

    Args:
        requests: Descriptor to write requests to.
        answers: Descriptor to read answers from.
        output: Descriptor to read printed output from.
        frame_bytes: Largest payload of an answer.
        output_bytes: Limit of the printed output.
    """

    def __init__(
        self,
        requests: int,
        answers: int,
        output: int,
        frame_bytes: int,
        output_bytes: int,
    ) -> None:
        self._late_deadline: Deadline | None = None
        self._late_reads = 0
        self._requests, self._answers, self._output = requests, answers, output
        self._frame_bytes, self._output_bytes = frame_bytes, output_bytes
        self._buffer = b""
        self.output_head, self.output_tail, self.output_count = b"", b"", 0
        self._poll = select.poll()
        for descriptor in (requests, answers, output):
            os.set_blocking(descriptor, False)
        for descriptor in (answers, output):
            self._poll.register(descriptor, select.POLLIN)

    def send(
        self, kind: int, sequence: int, payload: bytes, deadline: Deadline
    ) -> None:
        """Write one frame, reading printed output meanwhile."""
        data = memoryview(HEADER.pack(len(payload), kind, sequence) + payload)
        while data:
            try:
                data = data[os.write(self._requests, data) :]
            except BlockingIOError:
                self._wait_writable(deadline)
            except BrokenPipeError:
                raise ChannelClosedError from None

    def _wait_writable(self, deadline: Deadline) -> None:
        self._poll.register(self._requests, select.POLLOUT)
        try:
            for descriptor, _ in self._events(deadline):
                if descriptor == self._output:
                    self._drain()
                elif descriptor == self._answers:
                    raise FrameError("an answer before the request was read")
        finally:
            self._poll.unregister(self._requests)

    def receive(self, deadline: Deadline) -> tuple[int, int, bytes]:
        """Return kind, sequence number and payload of the one expected frame."""
        parts: list[bytes] = []
        have, need = 0, HEADER.size
        while have < need:
            for descriptor, _ in self._events(deadline):
                if descriptor == self._output:
                    self._drain()
                    continue
                part = self._read(CHUNK if parts else SHORT)
                parts.append(part)
                have += len(part)
            if need == HEADER.size and have >= need:
                parts = [b"".join(parts)]
                need = HEADER.size + self._size(parts[0])
        if have > need:
            raise FrameError(f"{have - need} bytes after an answer")
        data = b"".join(parts)
        _, kind, sequence = HEADER.unpack_from(data)
        return kind, sequence, data[HEADER.size :]

    def _size(self, data: bytes) -> int:
        size = int(HEADER.unpack_from(data)[0])
        if size > self._frame_bytes:
            raise FrameError(f"a frame of {size} bytes (limit {self._frame_bytes})")
        return size

    def _read(self, most: int) -> bytes:
        try:
            part = os.read(self._answers, most)
        except BlockingIOError:
            return b""
        if not part:
            raise ChannelClosedError
        return part

    def _events(self, deadline: Deadline) -> list[tuple[int, int]]:
        late = DeadlineError(busy=False)
        try:
            while (left := deadline()) > 0:
                if events := self._poll.poll(math.ceil(left * 1000)):
                    return events
        except DeadlineError as error:
            late = error
        if events := self._late_answer(deadline):
            return events
        raise late

    def _late_answer(self, deadline: Deadline) -> list[tuple[int, int]]:
        """Return the event of an answer that the judge had no CPU to read; or none.

        All of it must be there, and it is read in a few pieces, so that nothing can
        trickle in afterwards.
        """
        if self._late_deadline != deadline:
            self._late_deadline, self._late_reads = deadline, 0
        self._late_reads += 1
        events = [event for event in self._poll.poll(0) if event[0] == self._answers]
        return events if self._late_reads <= MOST_LATE_READS else []

    def _drain(self) -> bool:
        """Read printed output; return whether more can follow."""
        try:
            part = os.read(self._output, CHUNK)
        except BlockingIOError:
            return True
        if not part:
            # `drain_until_end` reads the end of file again.
            with contextlib.suppress(KeyError):
                self._poll.unregister(self._output)
            return False
        self.output_count += len(part)
        room = KEPT_OUTPUT - len(self.output_head)
        self.output_head += part[:room]
        self.output_tail = (self.output_tail + part[room:])[-KEPT_OUTPUT:]
        if self.output_count > self._output_bytes:
            raise OutputFloodError
        return True

    def drain_until_end(self, deadline: float) -> None:
        """Read output until every process that could print has ended."""
        poll = select.poll()
        poll.register(self._output, select.POLLIN)
        while (left := deadline - time.monotonic()) > 0:
            if poll.poll(math.ceil(left * 1000)):
                try:
                    if not self._drain():
                        return
                except OutputFloodError:
                    continue

    def close(self) -> None:
        """Close all three descriptors."""
        for descriptor in (self._requests, self._answers, self._output):
            os.close(descriptor)
