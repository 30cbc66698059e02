"""Read a CSV file of a user's folder, or refuse it with a one-line message."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from tdac_envs.core.intake import IMAGE_BYTES, read_file

TABLE_BYTES = IMAGE_BYTES
"""Size limit of a table."""


def read_rows(
    file: Path, columns: Sequence[str] = (), key: Sequence[str] = ()
) -> list[dict[str, str]]:
    """The rows of a CSV file with a heading.

    Args:
        file: The file.
        columns: Columns that it must have; others are allowed.
        key: Columns whose values together may occur only once.

    Raises:
        OSError: It cannot be read, or is not a regular file of limited size.
        ValueError: It is not such a table; the message names the line.
    """
    try:
        text = read_file(file, TABLE_BYTES).decode("utf-8")
    except UnicodeDecodeError:
        raise ValueError("not UTF-8 text") from None
    rows, seen = [], set[tuple[str, ...]]()
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        heading = next(reader, [])
        _check_heading(heading, columns)
        for values in reader:
            if len(values) != len(heading):
                raise ValueError(
                    f"line {reader.line_num}: {len(values)} values for "
                    f"{len(heading)} columns"
                )
            row = dict(zip(heading, values, strict=True))
            at = tuple(row[name] for name in key)
            if at and at in seen:
                raise ValueError(
                    f"line {reader.line_num}: a second row for "
                    + ", ".join(map("{} {}".format, key, at))[:200]
                )
            seen.add(at)
            rows.append(row)
    except csv.Error as error:
        raise ValueError(f"line {reader.line_num}: not CSV: {error}") from None
    return rows


def _check_heading(heading: Sequence[str], columns: Sequence[str]) -> None:
    if not heading:
        raise ValueError("no heading: the file is empty")
    if len(set(heading)) < len(heading):
        raise ValueError("two columns of one name")
    missing = [name for name in columns if name not in heading]
    if missing:
        raise ValueError(f"no column {missing[0]!r}")
