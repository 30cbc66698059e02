"""An append-only record of JSON lines, whole also after a crash in mid-line."""

from __future__ import annotations

import json
import os
from contextlib import suppress
from pathlib import Path
from typing import Any

from tdac_agent.storage.files import sync_folder
from tdac_envs.core.intake import check, read_file

JournalRecord = dict[str, Any]
JOURNAL_BYTES = 256_000_000


def append_record(path: Path, record: JournalRecord) -> None:
    """Appends one line, and forces it to the disk.

    A line that cannot be written as a whole is taken back.

    Raises:
        OSError: It names the file, whatever went wrong.
    """
    line = json.dumps(record, sort_keys=True).encode() + b"\n"
    try:
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        try:
            _write(handle, line)
            size = os.fstat(handle).st_size
        finally:
            os.close(handle)
        if size == len(line):
            sync_folder(path.parent)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


def _write(handle: int, line: bytes) -> None:
    size = os.fstat(handle).st_size
    try:
        # All at once; only a disk that is full takes a part, and then says why.
        while line:
            line = line[os.write(handle, line) :]
        os.fsync(handle)
    except OSError:
        with suppress(OSError):
            os.ftruncate(handle, size)
        raise


def read_records(path: Path) -> list[JournalRecord]:
    """All whole records; a torn or foreign line is none, a missing file has none."""
    try:
        raw = read_file(path, JOURNAL_BYTES)
    except FileNotFoundError:
        return []
    return _records(raw)


def read_on(path: Path, offset: int) -> tuple[list[JournalRecord], int]:
    """The records behind an offset, and the offset behind them; a torn end is mended.

    Args:
        path: A file that is there.
        offset: Where a line begins, as the last call gave it, or 0.
    """
    raw = _behind(path, offset)
    if raw and not raw.endswith(b"\n"):
        mend(path)
        raw = _behind(path, offset)
    return _records(raw), offset + len(raw)


def _behind(path: Path, offset: int) -> bytes:
    return read_file(path, JOURNAL_BYTES, offset)


def _records(raw: bytes) -> list[JournalRecord]:
    records = map(_record, raw.split(b"\n"))
    return [record for record in records if record is not None]


def mend(path: Path) -> None:
    """Has the file end with a whole line: a torn one is cut off.

    A last line that only lacks its end is kept, as `read_records` does.
    """
    try:
        raw = read_file(path, JOURNAL_BYTES)
    except FileNotFoundError:
        return
    tail = raw.rpartition(b"\n")[2]
    if not tail:
        return
    with path.open("r+b") as file:
        if _record(tail) is None:
            file.truncate(len(raw) - len(tail))
        else:
            file.seek(0, os.SEEK_END)
            file.write(b"\n")
        file.flush()
        os.fsync(file.fileno())


def _record(line: bytes) -> JournalRecord | None:
    try:
        record = json.loads(line.decode("utf-8"))
        check(record, any_text=True)
    except (ValueError, RecursionError):
        return None
    return record if isinstance(record, dict) else None
