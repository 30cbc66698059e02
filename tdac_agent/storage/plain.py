"""Texts of unknown origin, made fit to be stored, printed and quoted."""

from __future__ import annotations

import re
import reprlib
from typing import Any

MAX_MESSAGE = 300
MAX_VALUE = 80
"""Characters of a value that is quoted."""
MARK = "\N{REPLACEMENT CHARACTER}"
# Python calls none of these printable; line ends, tabs, and spaces that people write.
_KEPT = frozenset("\n\t\u00a0\u2009\u202f\u3000")
_FOLDERS = re.compile(r"(?<![\w.])(?:/[\w.+-]+)+/(?=[\w.+-])")
_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+|0x[0-9a-fA-F]{6,}")


def printable(text: str) -> str:
    """The text with a mark for each character that a reader does not see as itself.

    These are control characters, and with them escape sequences, characters that turn
    the direction of writing or have no width, and halves of surrogate pairs. The
    length stays.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in _KEPT else MARK for c in text)


def one_line(text: str) -> str:
    """The printable text in one line: no part of it can look like a line of ours."""
    return " ".join(printable(text).split())


class _Short(reprlib.Repr):
    """Looks at the first items of each collection only, and not far into it."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel = 3
        self.maxstring = self.maxlong = self.maxother = MAX_VALUE

    def repr_bytes(self, value: bytes, _: int) -> str:
        """The first of many."""
        return repr(value[:MAX_VALUE])

    def repr_ndarray(self, value: Any, _: int) -> str:
        """A small array whole, of another what it is."""
        if value.size <= 16:
            return repr(value)
        return f"array of shape {value.shape} and type {value.dtype}"


def shown(value: object, most: int = MAX_VALUE) -> str:
    """What a value looks like, in so many characters; none costs much to describe."""
    text = printable(_Short().repr(value))
    return text if len(text) <= most else f"{text[: most - 3]}..."


def plain(message: str) -> str:
    """One bounded line, folders cut short, without addresses and full stop."""
    line = one_line(_ADDRESS.sub("", _FOLDERS.sub("…/", message))).rstrip(".")
    return line if len(line) <= MAX_MESSAGE else f"{line[:MAX_MESSAGE]} …"
