"""An append-only file of JSON lines that survives a crash in mid-line."""

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
    """Appends one line and flushes it to disk.

    A partially written line is removed again.

    Raises:
        OSError: The write failed; the error names the file.
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
        # Usually one write; a full disk accepts a part, and the next write raises.
        while line:
            line = line[os.write(handle, line) :]
        os.fsync(handle)
    except OSError:
        with suppress(OSError):
            os.ftruncate(handle, size)
        raise


def read_records(path: Path) -> list[JournalRecord]:
    """Returns all records, without torn or invalid lines; [] for a missing file."""
    try:
        raw = read_file(path, JOURNAL_BYTES)
    except FileNotFoundError:
        return []
    return _records(raw)


def read_records_from(path: Path, offset: int) -> tuple[list[JournalRecord], int]:
    """Returns the records after an offset and the end offset; repairs a torn end.

    Args:
        path: An existing file.
        offset: Start of a line, as returned by the last call, or 0.
    """
    raw = _read_after(path, offset)
    if raw and not raw.endswith(b"\n"):
        repair_end(path)
        raw = _read_after(path, offset)
    return _records(raw), offset + len(raw)


def _read_after(path: Path, offset: int) -> bytes:
    return read_file(path, JOURNAL_BYTES, offset)


def _records(raw: bytes) -> list[JournalRecord]:
    records = map(_record, raw.split(b"\n"))
    return [record for record in records if record is not None]


def repair_end(path: Path) -> None:
    """Repairs the end of the file by cutting off a torn last line.

    A valid last line without a line end is completed, since `read_records` counts it.
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
