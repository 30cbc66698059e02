"""Sentences on a console: in its width on a terminal, each one line in a file."""

from __future__ import annotations

from rich.text import Text

from tdac_agent.cli.console import Console
from tdac_agent.cli.mistakes import folded


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
            told = folded(told, console.width, indent or 2)
        console.print(Text(told, style), soft_wrap=True)
