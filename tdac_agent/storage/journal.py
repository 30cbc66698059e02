"""An append-only file of JSON lines that survives a crash in mid-line."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from tdac_agent.storage.files import append_line, read_inside
from tdac_envs.core.intake import check, read_file

JournalRecord = dict[str, Any]
JOURNAL_BYTES = 256_000_000


def append_record(path: Path, record: JournalRecord) -> None:
    """Appends one line and flushes it to disk.

    A partially written line is removed again.

    Raises:
        OSError: The write failed; the error names the file.
    """
    append_line(path, line_of(record))


def line_of(record: JournalRecord) -> bytes:
    """The line of a record, with its end."""
    return json.dumps(record, sort_keys=True).encode() + b"\n"


def read_records(path: Path) -> list[JournalRecord]:
    """Returns all records, without torn or invalid lines; [] for a missing file."""
    try:
        raw = read_inside(path.parent, path.name, JOURNAL_BYTES)
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
    whole = whole_lines(raw)
    if whole == raw:
        return
    with path.open("r+b") as file:  # raw read: written, too
        file.truncate(len(whole))
        if len(whole) > len(raw):
            file.seek(-1, os.SEEK_END)
            file.write(b"\n")
        file.flush()
        os.fsync(file.fileno())


def whole_lines(raw: bytes) -> bytes:
    """The content of a journal as `repair_end` leaves it."""
    tail = raw.rpartition(b"\n")[2]
    if not tail:
        return raw
    return raw.removesuffix(tail) if _record(tail) is None else raw + b"\n"


def _record(line: bytes) -> JournalRecord | None:
    try:
        record = json.loads(line.decode("utf-8"))
        check(record, any_text=True)
    except (ValueError, RecursionError):
        return None
    return record if isinstance(record, dict) else None
