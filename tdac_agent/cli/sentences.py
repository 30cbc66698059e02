"""Prints sentences: wrapped on a terminal, one line each in a file."""

from __future__ import annotations

from rich.text import Text

from tdac_agent.cli.console import Console
from tdac_agent.cli.mistakes import folded


def print_sentences(
    console: Console, words: str, style: str = "", *, indent: int = 0
) -> None:
    """Prints sentences without breaking words or paths.

    Args:
        console: Console to print to.
        words: Text without markup, one sentence per line.
        style: Style of the whole text.
        indent: Columns to indent; wrapped lines are indented by at least two.
    """
    for line in words.splitlines():
        text = " " * indent + line
        if console.is_terminal:
            text = folded(text, console.width, indent or 2)
        console.print(Text(text, style), soft_wrap=True)
