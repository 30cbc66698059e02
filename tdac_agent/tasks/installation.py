"""The secret of an installation: what an author of controllers cannot know.

The moved starts of a verification follow from it, and by it a run folder of one's own
is told from others. It lies in the user's state folder, never in a run folder, a log or
a sandbox.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import hmac
import os
import secrets
import stat
import sys
import tempfile
from pathlib import Path

from tdac_agent.sandbox.exposure import exposure
from tdac_agent.tasks.task import Task
from tdac_envs.core.private import user_state

SECRET_BYTES = 32
SEED_BITS = 32
"""Of a derived seed: short enough to be typed, and nobody can aim at it."""


@functools.cache
def lasting_secret() -> bytes | None:
    """The secret that was made once; None where none can be kept, which is said."""
    path = secret_file()
    if path is None:
        _tell("there is no home")
        return None
    if any(path.is_relative_to(shown) for shown in _shown()):
        _tell(f"{path} is where controllers may read")
        return None
    try:
        if not path.exists():
            _make(path)
        return _read(path)
    except OSError as error:
        _tell(f"{path}: {error.strerror}")
        return None


def secret_file() -> Path | None:
    """Where the secret lies; None for a user without a home."""
    folder = user_state()
    return None if folder is None else folder.resolve() / "tdac" / "secret"


def _shown() -> tuple[str, ...]:
    """Folders that every sandbox shows."""
    seen = exposure()
    return (*seen.system, *seen.packages)


@functools.cache
def _drawn_secret() -> bytes:
    return secrets.token_bytes(SECRET_BYTES)


def seed_of(source: bytes, task: Task) -> int:
    """Seed of the moved starts of a controller, where none is given.

    It follows from the bytes of the controller, from the task and from the secret: the
    same file gets the same verdict on one machine, and no author can aim at it.
    """
    about = f"starts|{hashlib.sha256(source).hexdigest()}|{task.sha256()}"
    return int.from_bytes(keyed(about.encode())[: SEED_BITS // 8], "big")


def drawn_seed() -> int:
    """A seed for a run that no secret outlives."""
    return secrets.randbits(SEED_BITS)


def keyed(message: bytes) -> bytes:
    """HMAC-SHA256 of a message with the secret."""
    return hmac.digest(lasting_secret() or _drawn_secret(), message, "sha256")


def _read(path: Path) -> bytes:
    """A file that this user alone can have read or written."""
    handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    with os.fdopen(handle, "rb") as file:
        status, content = os.fstat(handle), b""
        if stat.S_ISREG(status.st_mode):
            content = file.read(SECRET_BYTES + 1)
    shared = status.st_mode & (stat.S_IRWXG | stat.S_IRWXO)
    if status.st_uid != os.geteuid() or shared or len(content) != SECRET_BYTES:
        told = f"not a file of {SECRET_BYTES} bytes for its owner alone; remove it"
        raise OSError(0, told)
    return content


def _make(path: Path) -> None:
    """Writes a new secret, unless another process was first."""
    path.parent.mkdir(0o700, parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(secrets.token_bytes(SECRET_BYTES))
            file.flush()
            os.fsync(handle)
        with contextlib.suppress(FileExistsError):
            os.link(name, path)
    finally:
        os.unlink(name)


def _tell(reason: str) -> None:
    told = "moved starts are drawn for this run alone; its report has their seed"
    print(f"tdac: no secret can be kept ({reason}): {told}", file=sys.stderr)
