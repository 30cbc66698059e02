"""Lines and sentences: whole in a file, on a terminal as wide as that."""

import io
import os
import pty
import sys

import pytest
from rich.console import Console

from tdac_agent.cli.mistakes import begun, fitted
from tdac_agent.cli.sentences import print_sentences

LINE = "error: " + "words that are rather many " * 6 + "/a/path/" + "x" * 99


def test_a_line_stays_one_where_nobody_looks():
    """A file or a pipe gets it whole."""
    assert fitted(LINE) == LINE


@pytest.mark.parametrize("columns", [40, 80])
def test_a_terminal_gets_it_in_its_width(monkeypatch, columns):
    """It goes on below its text; nothing is cut, no path broken."""
    master, slave = pty.openpty()
    monkeypatch.setenv("COLUMNS", str(columns))
    with os.fdopen(slave, "w") as terminal, os.fdopen(master):
        monkeypatch.setattr(sys, "stderr", terminal)
        lines = fitted(LINE).splitlines()
    assert len(lines) > 2
    assert all(line.startswith("  ") for line in lines[1:])
    assert " ".join(line.strip() for line in lines) == LINE
    assert all(len(line) <= columns for line in lines[:-1])


def test_that_a_command_begins_is_said_on_a_terminal_alone(monkeypatch, capsys):
    """At once, and it is gone when there is something to show."""
    master, slave = pty.openpty()
    with begun():
        assert capsys.readouterr().err == ""
    with os.fdopen(slave, "w") as terminal, os.fdopen(master) as screen:
        monkeypatch.setattr(sys, "stderr", terminal)
        with begun():
            assert os.read(screen.fileno(), 99).decode() == "starting …\r"
        assert os.read(screen.fileno(), 99) == b"\x1b[2K"


@pytest.mark.parametrize("indent", [0, 2])
def test_sentences_on_a_console(indent):
    """Each goes on below its text on a terminal, and is one line elsewhere."""
    words = f"{LINE}\n[red]no markup[/]"
    for terminal in (False, True):
        console = Console(file=io.StringIO(), width=60, force_terminal=terminal)
        print_sentences(console, words, indent=indent)
        lines = console.file.getvalue().splitlines()
        assert lines[-1] == " " * indent + "[red]no markup[/]"
        assert lines[0].startswith(" " * indent + "error: words")
        assert " ".join(line.strip() for line in lines[:-1]) == LINE
        assert (len(lines) == 2) != terminal
        assert all(line.startswith("  ") for line in lines[1:-1])
