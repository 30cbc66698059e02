"""Sentences on a console: in its width on a terminal, each one line in a file."""

from __future__ import annotations

import textwrap

from rich.console import Console
from rich.text import Text


def tell(console: Console, words: str, style: str = "", *, indent: int = 0) -> None:
    """Prints sentences; no word, path or command word is broken, nothing is cut.

    Args:
        console: Where to.
        words: A line each; no markup.
        style: Of all of it.
        indent: Columns before it. What goes on in the next line has two at least.
    """
    for line in words.splitlines():
        told = " " * indent + line
        if console.is_terminal:
            told = textwrap.fill(
                told,
                console.width,
                subsequent_indent=" " * (indent or 2),
                break_long_words=False,
                break_on_hyphens=False,
            )
        console.print(Text(told, style), soft_wrap=True)
