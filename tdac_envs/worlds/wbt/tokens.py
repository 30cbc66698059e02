"""Tokenizer for `.wbt` files."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite
from typing import Literal, NamedTuple

from tdac_envs.core.errors import WorldFileError

Kind = Literal["number", "string", "word", "mark", "end"]

# A comma is white space. The first character decides whether a token is a number.
_TOKEN = re.compile(
    r"""[\s,]+ | \#[^\n]*
    | (?P<string>"(?:[^"\\\n]|\\[^\n])*")
    | (?P<mark>[][{}])
    | (?P<number>[-+.0-9][^][{}\s,#"]*)
    | (?P<word>[^][{}\s,#"][^][{}\s,#"]*)
    | (?P<open>")""",
    re.VERBOSE,
)
_ESCAPE = re.compile(r"\\(.)")


class Token(NamedTuple):
    """A token.

    Attributes:
        kind: Type of the token.
        text: Text in the file; for a string, its content.
        offset: Index of the first character.
    """

    kind: Kind
    text: str
    offset: int


@dataclass(frozen=True, slots=True, eq=False)
class SourceText:
    """The text of a file, which converts offsets to lines and columns.

    Attributes:
        name: File name.
        text: Text with LF as the only line end.
    """

    name: str
    text: str

    def line(self, offset: int) -> int:
        """Line number of an offset, from 1."""
        return self.text.count("\n", 0, offset) + 1

    def error(self, offset: int, message: str) -> WorldFileError:
        """An error at an offset, with line and column, both from 1."""
        column = offset - self.text.rfind("\n", 0, offset)
        where = f"{self.name}, line {self.line(offset)}, column {column}"
        return WorldFileError(f"{where}: {message}")


def tokens(source: SourceText, start: int = 0) -> Iterator[Token]:
    """Yields the tokens from `start` on, then an `end` token.

    Raises:
        WorldFileError: A string is not closed, or a number is invalid.
    """
    for match in _TOKEN.finditer(source.text, start):
        kind, text = match.lastgroup, match.group()
        if kind == "string":
            yield Token("string", _ESCAPE.sub(_unescaped, text[1:-1]), match.start())
        elif kind == "mark":
            yield Token("mark", text, match.start())
        elif kind == "word":
            yield Token("word", text, match.start())
        elif kind == "number":
            yield Token("number", _checked(source, text, match.start()), match.start())
        elif kind == "open":
            raise source.error(match.start(), "a string is not closed on its line")
    yield Token("end", "the end of the file", len(source.text))


def _unescaped(match: re.Match[str]) -> str:
    return "\n" if match[1] == "n" else match[1]


def _checked(source: SourceText, text: str, offset: int) -> str:
    try:
        good = isfinite(float(text)) and "_" not in text
    except ValueError:
        good = False
    if not good:
        raise source.error(offset, f"expected a number, got {text[:40]!r}")
    return text
