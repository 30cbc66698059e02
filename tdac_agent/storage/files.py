"""Files that others may have written are read safely, and ours written atomically."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
import tempfile
from collections.abc import Generator
from io import BufferedReader
from pathlib import Path

from tdac_envs.core.intake import read_file

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


def read_inside(folder: Path, name: str | Path, most: int) -> bytes:
    """The bytes of a file in a folder, which may be somebody else's.

    Args:
        folder: The folder.
        name: The file, relative to it.
        most: Maximum number of bytes.

    Raises:
        OSError: As `read_file`, or a link leads out of the folder: to a file that its
            author wants to be read.
    """
    path = folder / name
    check_inside(folder, path)
    return read_file(path, most)


def resolved(path: Path) -> Path:
    """The path without links; what it leads to may be missing.

    Raises:
        OSError: The links lead in a circle, which Python 3.13 alone lets pass.
        RuntimeError: The same, in earlier Pythons.
    """
    found = path.resolve()
    try:
        found.stat()
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise
    return found


def check_inside(folder: Path, path: Path) -> None:
    """Refuses a path through which a link leads out of a folder.

    Raises:
        OSError: There is such a link; `strerror` says so.
    """
    try:
        inside = resolved(path).is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError):
        inside = False  # links in a circle, or no valid name
    if not inside:
        raise OSError(errno.EPERM, "a link that leads out of its folder", str(path))


@contextlib.contextmanager
def open_regular(path: Path) -> Generator[BufferedReader]:
    """Opens a regular file of any size for reading in a `with` block.

    Raises:
        OSError: It is missing, or is a pipe, a device or a folder.
    """
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOCTTY)
    with os.fdopen(handle, "rb") as file:
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            raise OSError(errno.EINVAL, "not a regular file", str(path))
        yield file


def write_if_changed(path: Path, data: str | bytes) -> None:
    """Writes a file unless it already contains this text (as UTF-8), or these bytes."""
    raw = data.encode("utf-8", "surrogatepass") if isinstance(data, str) else data
    if not _contains(path, raw):
        write_atomic(path, raw)


def _contains(path: Path, raw: bytes) -> bool:
    try:
        return read_file(path, len(raw)) == raw
    except OSError:
        return False


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
