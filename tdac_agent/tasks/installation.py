"""The installation secret, which authors of controllers do not know.

It determines the jittered starts of a verification and marks the run folders that this
installation created. It is stored in the user's state folder, never in a run folder, a
log or a sandbox.
"""

from __future__ import annotations

import contextlib
import functools
import hmac
import os
import secrets
import stat
import sys
import tempfile
from pathlib import Path

from tdac_agent.sandbox.exposure import exposure
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.tasks.task import Task
from tdac_envs.core.trusted_folders import user_state

SECRET_BYTES = 32
SEED_BITS = 32
"""Length of a derived seed: short enough to type, and not predictable."""


@functools.cache
def lasting_secret() -> bytes | None:
    """Returns the stored or a new secret; warns and returns None if that fails."""
    path = secret_file()
    if path is None:
        _warn("there is no home folder")
        return None
    if any(path.is_relative_to(folder) for folder in _folders_in_sandboxes()):
        _warn(f"controllers can read {path}")
        return None
    try:
        if not path.exists():
            _create(path)
        return _read(path)
    except OSError as error:
        _warn(f"{path}: {error.strerror}")
        return None


def secret_file() -> Path | None:
    """Returns the path of the secret; None for a user without a home folder."""
    folder = user_state()
    return None if folder is None else folder.resolve() / "tdac" / "secret"


def _folders_in_sandboxes() -> tuple[str, ...]:
    exposed = exposure()
    return (*exposed.system, *exposed.packages)


@functools.cache
def _drawn_secret() -> bytes:
    return secrets.token_bytes(SECRET_BYTES)


def seed_of(source: bytes, task: Task) -> int:
    """Returns the default seed of a controller's jittered starts.

    It depends on the controller's bytes, the task and the secret: on one machine the
    same file gets the same verdict, and no author can predict the starts.
    """
    return seed_from(source, task.sha256())


def seed_from(source: bytes, task_sha256: str) -> int:
    """Like `seed_of`, for the hash of a task or task set."""
    about = f"starts|{sha256_of(source)}|{task_sha256}"
    return int.from_bytes(keyed(about.encode())[: SEED_BITS // 8], "big")


def drawn_seed() -> int:
    """Returns a random seed, for a run without a stored secret."""
    return secrets.randbits(SEED_BITS)


def keyed(message: bytes) -> bytes:
    """Returns the HMAC-SHA256 of a message with the secret."""
    return hmac.digest(lasting_secret() or _drawn_secret(), message, "sha256")


def _read(path: Path) -> bytes:
    """Reads the secret, if only this user can have read or written the file."""
    handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    with os.fdopen(handle, "rb") as file:
        status, content = os.fstat(handle), b""
        if stat.S_ISREG(status.st_mode):
            content = file.read(SECRET_BYTES + 1)
    shared = status.st_mode & (stat.S_IRWXG | stat.S_IRWXO)
    if status.st_uid != os.geteuid() or shared or len(content) != SECRET_BYTES:
        raise OSError(
            0, f"not a file of {SECRET_BYTES} bytes that only you can access; remove it"
        )
    return content


def _create(path: Path) -> None:
    """Writes a new secret, unless another process has written one."""
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


def _warn(reason: str) -> None:
    effect = "jittered starts are drawn for this run only; its report has their seed"
    print(f"tdac: cannot store a secret ({reason}): {effect}", file=sys.stderr)
