"""Prints sentences, which are wrapped on a terminal, and lines that can be copied."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

from rich.markup import escape
from rich.padding import Padding
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


def print_indented(console: Console, text: str) -> None:
    """Prints a wrapped sentence below the line that it belongs to, unless empty."""
    if text:
        console.print(Padding(escape(text), (0, 0, 0, 2)))


def print_plain(console: Console, text: str) -> None:
    """Prints a text without markup in one line, so that it can be copied."""
    console.print(Text(text), soft_wrap=True)


def print_command(console: Console, before: str, words: Sequence[str]) -> None:
    """Prints a command of tdac in one line, after a text with markup."""
    line = f"{before} [bold]{escape(shlex.join(['tdac', *words]))}[/]"
    console.print(line, soft_wrap=True, highlight=False)
