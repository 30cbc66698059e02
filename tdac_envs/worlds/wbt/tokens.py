"""The words of a `.wbt` file."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite
from typing import Literal, NamedTuple

from tdac_envs.core.errors import WorldFileError

Kind = Literal["number", "string", "word", "mark", "end"]

# A comma is white space. A number's first character decides that it is one.
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
    """A word.

    Attributes:
        kind: What it is.
        text: As in the file; of a string, its content.
        offset: Index of its first character.
    """

    kind: Kind
    text: str
    offset: int


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """A text, and how to say where something in it is.

    Attributes:
        name: Of the file.
        text: With LF as the only line end.
    """

    name: str
    text: str

    def line(self, offset: int) -> int:
        """Number of the line, from 1."""
        return self.text.count("\n", 0, offset) + 1

    def error(self, offset: int, message: str) -> WorldFileError:
        """An error that says line and column, both from 1."""
        column = offset - self.text.rfind("\n", 0, offset)
        where = f"{self.name}, line {self.line(offset)}, column {column}"
        return WorldFileError(f"{where}: {message}")


def tokens(source: Source, start: int = 0) -> Iterator[Token]:
    """The words from `start` on, and an end.

    Raises:
        WorldFileError: A string is not closed, or a number cannot be read.
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


def _checked(source: Source, text: str, offset: int) -> str:
    try:
        good = isfinite(float(text)) and "_" not in text
    except ValueError:
        good = False
    if not good:
        raise source.error(offset, f"expected a number, got {text[:40]!r}")
    return text
