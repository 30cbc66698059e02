"""Atomic file writes: an interrupted program leaves no partial file."""

from __future__ import annotations

import contextlib
import os
import tempfile
from pathlib import Path

UNFINISHED = ".unfinished"


def write_atomic(path: Path, data: str | bytes, *, lasting: bool = True) -> None:
    """Writes a file under a temporary name and moves it into place.

    Args:
        path: Target file; its folder must exist.
        data: Text (as UTF-8) or bytes.
        lasting: Whether the file must survive a machine crash right afterwards (fsync).

    Raises:
        OSError: The write failed; the error names the file.
    """
    raw = data.encode("utf-8", "surrogatepass") if isinstance(data, str) else data
    try:
        _write(path, raw, lasting)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


def _write(path: Path, raw: bytes, lasting: bool) -> None:
    handle, name = tempfile.mkstemp(UNFINISHED, f".{path.name}.", path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(raw)
            file.flush()
            if lasting:
                os.fsync(file.fileno())
        os.chmod(name, 0o644)
        os.replace(name, path)
        if lasting:
            sync_folder(path.parent)
    except BaseException:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(name)
        raise


def write_if_changed(path: Path, data: str | bytes) -> None:
    """Writes a file unless it already contains this text (as UTF-8), or these bytes."""
    raw = data.encode("utf-8", "surrogatepass") if isinstance(data, str) else data
    if not path.is_file() or path.read_bytes() != raw:
        write_atomic(path, raw)


def append_line(path: Path, line: bytes) -> None:
    """Appends one line and flushes it to disk; a part of it is removed again.

    Raises:
        OSError: The write failed; the error names the file.
    """
    try:
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        try:
            _append(handle, line)
            size = os.fstat(handle).st_size
        finally:
            os.close(handle)
        if size == len(line):
            sync_folder(path.parent)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


def _append(handle: int, line: bytes) -> None:
    size = os.fstat(handle).st_size
    try:
        # Usually one write; a full disk accepts a part, and the next write raises.
        while line:
            line = line[os.write(handle, line) :]
        os.fsync(handle)
    except OSError:
        with contextlib.suppress(OSError):
            os.ftruncate(handle, size)
        raise


def sync_folder(folder: Path) -> None:
    """Flushes the entries of a folder to disk, if the system supports it."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def clear_unfinished(folder: Path) -> None:
    """Removes temporary files that a program left when it was killed."""
    for path in folder.rglob(f".*{UNFINISHED}"):
        path.unlink(missing_ok=True)
