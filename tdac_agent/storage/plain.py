"""Make texts of unknown origin safe to store, print and quote."""

from __future__ import annotations

import re
import reprlib
from typing import Any

MAX_MESSAGE = 300
MAX_VALUE = 80
"""Maximum length of a quoted value."""
MARK = "\N{REPLACEMENT CHARACTER}"
# Legitimate whitespace that `str.isprintable` rejects.
_KEPT = frozenset("\n\t\u00a0\u2009\u202f\u3000")
_FOLDERS = re.compile(r"(?<![\w.])(?:/[\w.+-]+)+/(?=[\w.+-])")
_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+|0x[0-9a-fA-F]{6,}")


def printable(text: str) -> str:
    """Replaces each character that is not displayed as itself with a mark.

    This covers control characters (and so escape sequences), lone surrogates, and
    characters that have no width or change the writing direction. The length is kept.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in _KEPT else MARK for c in text)


def one_line(text: str) -> str:
    """Returns the printable text as one line, so that it cannot imitate other lines."""
    return " ".join(printable(text).split())


class _Short(reprlib.Repr):
    """Describes only the first items of a collection, a few levels deep."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel = 3
        self.maxstring = self.maxlong = self.maxother = MAX_VALUE

    def repr_bytes(self, value: bytes, _: int) -> str:
        """Shows only the first bytes."""
        return repr(value[:MAX_VALUE])

    def repr_ndarray(self, value: Any, _: int) -> str:
        """Shows a small array completely, a larger one by shape and type."""
        if value.size <= 16:
            return repr(value)
        return f"array of shape {value.shape} and type {value.dtype}"


def shown(value: object, most: int = MAX_VALUE) -> str:
    """Describes a value of any size cheaply, in at most `most` characters."""
    text = printable(_Short().repr(value))
    return text if len(text) <= most else f"{text[: most - 3]}..."


def plain(message: str) -> str:
    """Returns one short line: folders as `…/`, no addresses, no final full stop."""
    line = one_line(_ADDRESS.sub("", _FOLDERS.sub("…/", message))).rstrip(".")
    return line if len(line) <= MAX_MESSAGE else f"{line[:MAX_MESSAGE]} …"
