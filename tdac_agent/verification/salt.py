"""Salts of hidden worlds that are drawn here, when the entrants are on record."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

SEALED = "sealed"
"""Subfolder that only its user can read: the salt of the hidden worlds."""
SALT_FILE = "salt"
SALT_BYTES = 32


def drawn_salt(folder: Path, *, reuse: bool) -> Path:
    """The file with the salt of a run, 0600 in a folder 0700.

    Args:
        folder: Its folder, which is made.
        reuse: Whether a salt that an interrupted process drew is used.
    """
    folder.mkdir(mode=0o700, exist_ok=True)
    folder.chmod(0o700)
    path = folder / SALT_FILE
    if not (reuse and path.exists()):
        unfinished = folder / f"{SALT_FILE}.new"
        handle = os.open(unfinished, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        with os.fdopen(handle, "wb") as file:
            file.write(secrets.token_bytes(SALT_BYTES))
            file.flush()
            os.fsync(handle)
        unfinished.rename(path)
    return path
