"""Locks between processes; the system lets go of those of a process that has died."""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

LOCK_FILE = ".lock"
TRIES = 5
TRY_SECONDS = 0.1
"""Somebody who looks whether a lock is held, holds it for a moment."""


def open_lock(file: Path) -> int:
    """A descriptor of a file to be locked, which is made where it is missing.

    A link in its place is an OSError: it would make a file wherever it points to.
    """
    return os.open(file, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)


@contextmanager
def hold(file: Path) -> Generator[bool]:
    """Holds the lock of a file meanwhile; gives False where another process does."""
    handle = open_lock(file)
    try:
        yield any(_take(handle, attempt) for attempt in range(TRIES))
    finally:
        os.close(handle)


def _take(handle: int, attempt: int) -> bool:
    if attempt:
        time.sleep(TRY_SECONDS)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


@contextmanager
def wait_for(file: Path) -> Generator[None]:
    """Holds the lock of a file meanwhile, and waits for it as long as it takes."""
    handle = open_lock(file)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def is_held(file: Path) -> bool:
    """Whether a process holds the lock of a file."""
    try:
        handle = os.open(file, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError:
        return False
    try:
        fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    else:
        return False
    finally:
        os.close(handle)
