"""Locks between processes; the system releases those of a dead process."""

from __future__ import annotations

import fcntl
import os
import time
from collections.abc import Generator, Iterable
from contextlib import ExitStack, contextmanager
from pathlib import Path

from tdac_agent.errors import RunError
from tdac_agent.storage.links import refuse_links

LOCK_FILE = ".lock"
TRIES = 5
TRY_SECONDS = 0.1
"""`is_held` takes the lock for a moment, so one failed attempt proves nothing."""


def open_lock(file: Path) -> int:
    """Returns a descriptor of a lock file, which is created if it is missing.

    A symbolic link raises OSError: following it could create a file elsewhere.
    """
    return os.open(file, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o644)


@contextmanager
def hold(file: Path) -> Generator[bool]:
    """Locks a file in a `with` block; yields False if another process holds it."""
    handle = open_lock(file)
    try:
        yield any(_take(handle, attempt) for attempt in range(TRIES))
    finally:
        os.close(handle)


@contextmanager
def own_folder(
    out: Path, *names: str, who: str = "process", lock: str = LOCK_FILE
) -> Generator[None]:
    """Makes a folder and holds its lock in a `with` block.

    Args:
        out: The folder.
        names: What is written in it, see `refuse_links`.
        who: What writes to it, for the message: `evaluation`.
        lock: The lock file, relative to the folder.

    Raises:
        RunError: It cannot be written, another process holds its lock, or a link leads
            out of it.
    """
    with ExitStack() as stack:
        try:
            out.mkdir(parents=True, exist_ok=True)
            refuse_links(out, *names, lock.partition("/")[0])
            (out / lock).parent.mkdir(exist_ok=True)
            held = stack.enter_context(hold(out / lock))
        except OSError as error:
            raise RunError(f"cannot write to {out}: {error.strerror}") from error
        if not held:
            raise RunError(f"another {who} is at work on {out}; wait until it ends")
        yield


def first_free(files: Iterable[Path]) -> tuple[int, int] | None:
    """Locks the first file that no process holds; they are created if missing.

    Returns:
        Number of the file and a descriptor, which releases the lock when it is closed.
        None if all are held.
    """
    for number, file in enumerate(files):
        handle = open_lock(file)
        if _take(handle, 0):
            return number, handle
        os.close(handle)
    return None


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
    """Locks a file in a `with` block; waits for the lock without a time limit."""
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
