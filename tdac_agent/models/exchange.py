"""Exchange of texts with a program, without holding more than an answer may have."""

from __future__ import annotations

import os
import selectors
import subprocess
import time
from contextlib import suppress
from functools import partial
from selectors import EVENT_READ, EVENT_WRITE

from tdac_agent.models.bounds import COMMAND_BYTES, ERROR_BYTES
from tdac_agent.models.provider import ProviderFault

PIECE = 1 << 16


def exchange(
    process: subprocess.Popen[bytes], prompt: bytes, seconds: float
) -> tuple[bytes, bytes]:
    """Returns a program's output, and the end of its error output.

    Args:
        process: The program, started with three pipes.
        prompt: What it may read.
        seconds: How long it may take.

    Raises:
        TimeoutError: It took longer.
        ProviderFault: It wrote too much.
    """
    end = time.monotonic() + seconds
    out, err = bytearray(), bytearray()
    work = (
        (process.stdin, EVENT_WRITE, partial(_write, bytearray(prompt))),
        (process.stdout, EVENT_READ, partial(_read, out)),
        (process.stderr, EVENT_READ, partial(_read, err)),
    )
    pipes = {pipe.fileno(): pipe for pipe, _, _ in work if pipe is not None}
    with selectors.DefaultSelector() as ready:
        for pipe, (_, direction, step) in zip(pipes, work, strict=True):
            os.set_blocking(pipe, False)
            ready.register(pipe, direction, step)
        while ready.get_map():
            for key, _ in ready.select(_left(end)):
                if not key.data(key.fd):
                    ready.unregister(key.fd)
                    pipes[key.fd].close()
            if len(out) > COMMAND_BYTES:
                most = f"{COMMAND_BYTES / 1e6:g} MB"
                raise ProviderFault(f"the program wrote more than {most}")
            del err[:-ERROR_BYTES]
    try:
        process.wait(_left(end))
    except subprocess.TimeoutExpired:
        raise TimeoutError from None
    return bytes(out), bytes(err)


def _left(end: float) -> float:
    """Returns the seconds until a time of the monotonic clock.

    Raises:
        TimeoutError: There are none.
    """
    left = end - time.monotonic()
    if left <= 0:
        raise TimeoutError
    return left


def _write(pending: bytearray, pipe: int) -> bool:
    """Writes what a pipe takes; False if nothing is left, or nobody reads."""
    with suppress(BlockingIOError):
        try:
            del pending[: os.write(pipe, pending[:PIECE])]
        except BrokenPipeError:
            return False
    return bool(pending)


def _read(into: bytearray, pipe: int) -> bool:
    """Appends what is in a pipe; False at its end."""
    with suppress(BlockingIOError):
        piece = os.read(pipe, PIECE)
        into += piece
        return bool(piece)
    return True
