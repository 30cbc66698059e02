"""Marks the checkpoints of this installation; loading others could run any code."""

from __future__ import annotations

import hmac
import os
from pathlib import Path

from tdac_agent.storage.files import sync_folder, write_atomic
from tdac_agent.storage.hashes import sha256_of_large_file
from tdac_agent.tasks.installation import keyed, lasting_secret
from tdac_agent.tasks.trust import Wish, permit
from tdac_envs.core.intake import TEXT_BYTES, read_file

CHECKPOINT, REPLAY = "checkpoint.zip", "replay.pkl"
MARKS = "checkpoint.mark"
"""MACs of the last `KEPT` files, one per line; the previous files stay valid."""
KEPT = 4


def install_checkpoint(draft: Path, file: Path) -> None:
    """Marks a draft as written by this installation, then renames it to `file`."""
    marks = file.parent / MARKS
    if lasting_secret() is not None:
        lines = [*_lines(marks)[1 - KEPT :], _mark(file.name, draft)]
        write_atomic(marks, "\n".join(lines) + "\n")
    with draft.open("rb") as written:  # raw read: only to flush our own file
        os.fsync(written.fileno())
    os.replace(draft, file)
    sync_folder(file.parent)


def check(folder: Path, *, trust: bool) -> None:
    """Refuses checkpoints that this installation did not write.

    Args:
        folder: Folder of a training.
        trust: Whether the user trusts the files this time.

    Raises:
        NotTrustedError: There is such a file, and `trust` is false.
    """
    files = [folder / name for name in (CHECKPOINT, REPLAY)]
    permit(
        folder,
        [
            Wish(f"load {file}, which can run any code", (), sha256_of_large_file(file))
            for file in files
            if file.is_file() and not _is_own(file)
        ],
        trust=trust,
    )


def _is_own(file: Path) -> bool:
    mark = _mark(file.name, file).encode()
    known = [line.encode() for line in _lines(file.parent / MARKS)]
    own = lasting_secret() is not None
    return own and any(hmac.compare_digest(mark, line) for line in known)


def _mark(name: str, file: Path) -> str:
    return keyed(f"checkpoint|{name}|{sha256_of_large_file(file)}".encode()).hex()


def _lines(marks: Path) -> list[str]:
    try:
        text = read_file(marks, TEXT_BYTES).decode("utf-8", "replace")
    except OSError:
        return []
    return text.splitlines()[-KEPT:]
