"""The child's end of the channel: one frame in, one frame out, blocking."""

from __future__ import annotations

import os

from .wire import HEADER, Kind, WireError

CHUNK = 1 << 16
SHORT = 1 << 12


class Link:
    """Reads requests from one descriptor and writes answers to another.

    Args:
        requests: Descriptor to read from.
        answers: Descriptor to write to.
    """

    def __init__(self, requests: int, answers: int) -> None:
        self._requests = requests
        self._answers = answers
        self.frame_bytes = 1 << 20

    def receive(self) -> tuple[int, int, bytes]:
        """Return kind, sequence number and payload of the next request.

        Ends the process when the judge has closed its end.
        """
        data = self._read(SHORT)
        while len(data) < HEADER.size:
            data += self._read(SHORT)
        size, kind, sequence = HEADER.unpack_from(data)
        data = data[HEADER.size :]
        if len(data) < size:
            parts = [data]
            missing = size - len(data)
            while missing:
                parts.append(self._read(min(missing, CHUNK)))
                missing -= len(parts[-1])
            data = b"".join(parts)
        return kind, sequence, data

    def _read(self, most: int) -> bytes:
        data = os.read(self._requests, most)
        if not data:
            os._exit(0)
        return data

    def send(self, kind: Kind, sequence: int, payload: bytes) -> None:
        """Write one frame.

        Raises:
            WireError: The payload exceeds the size limit of a frame.
        """
        if len(payload) > self.frame_bytes:
            raise WireError(
                f"a value of {len(payload)} bytes is too large "
                f"(limit {self.frame_bytes})"
            )
        data = memoryview(HEADER.pack(len(payload), kind, sequence) + payload)
        while data:
            data = data[os.write(self._answers, data) :]
