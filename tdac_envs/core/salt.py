"""Salts of hidden worlds, read from files."""

from __future__ import annotations

from pathlib import Path

from tdac_envs.core.errors import TaskError, one_line_reason
from tdac_envs.core.intake import read_file

LEAST_SALT = 16
"""Least length of the salt of a hidden split, bytes."""
MOST_SALT = 4096


def read_salt(path: str | Path) -> bytes:
    """The salt in a file: its bytes, or in a file `*.hex` those that it spells.

    Raises:
        TaskError: The file cannot be read.
    """
    spelt = Path(path).suffix == ".hex"
    try:
        raw = read_file(path, 2 * MOST_SALT + 1 if spelt else MOST_SALT)
        return bytes.fromhex(raw.decode()) if spelt else raw
    except OSError as error:
        raise TaskError(f"salt file {path}: {one_line_reason(error)}") from None
    except ValueError:
        raise TaskError(f"salt file {path}: expected hexadecimal digits") from None
