"""Nothing that comes from somebody else steers the terminal, whatever prints it."""

import ast
import io
import logging
import os
import pty
import re
import subprocess
import sys
import traceback
from pathlib import Path

import pytest
from rich.markup import escape
from rich.progress import Progress, TextColumn
from rich.table import Table
from rich.text import Text
from small import write_small_task

import tdac_agent
from tdac_agent.cli.console import Console
from tdac_agent.cli.terminal import filter_streams, unfiltered
from tdac_agent.storage.plain import MARK, one_line, printable

# Clears the screen, sets the title, hides text, turns it; half a character, a bell.
EVIL = "\x1b[2J\x1b]0;owned\x07\x9b8m\u202e\udc80\x7f\u200b"
STEERING = set(EVIL) - set("[2J]0;owned8m")
TAME = "".join(MARK if c in STEERING else c for c in EVIL)


def test_what_steers_becomes_visible_and_the_rest_stays():
    """One mark for each such character; words, tabs, lines and spaces are kept."""
    assert printable(EVIL) == TAME
    kept = "Größe 大\t↦ 3\u00a0m\u202fs\u3000🤖\n"
    assert printable(kept) == kept
    assert one_line("a\r\nverified: 41 of 41\x85 b\u2028c") == (
        f"a{MARK} verified: 41 of 41{MARK} b{MARK}c"
    )


def filtered(monkeypatch):
    """What both streams, which are filtered from now on, write to."""
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stdout", stream)
    monkeypatch.setattr(sys, "stderr", stream)
    filter_streams()
    return stream


def test_whatever_python_prints_is_filtered(monkeypatch):
    """`print`, tracebacks and log lines, none of which knows of a filter."""
    stream = filtered(monkeypatch)
    print(EVIL)
    sys.stdout.writelines([EVIL, "\n"])
    try:
        raise ValueError(EVIL)
    except ValueError as error:
        traceback.print_exception(error)
    logging.lastResort.handle(logging.makeLogRecord({"msg": EVIL, "levelno": 40}))
    assert stream.getvalue().count(TAME) == 4
    assert not set(stream.getvalue()) & STEERING


def test_a_stream_is_filtered_once_and_otherwise_itself(monkeypatch):
    """A second command in one process adds no second filter."""
    stream = filtered(monkeypatch)
    once = sys.stdout
    filter_streams()
    assert sys.stdout is once
    assert unfiltered(sys.stdout) is stream
    assert not sys.stdout.isatty()


def draw(console, text):
    """Prints a text in each way in which commands do."""
    console.print(escape(text), style="red")
    console.print(Text(f"picture: {text}".replace("\x07", MARK)), soft_wrap=True)
    table = Table(title=escape(text))
    table.add_column(escape(text))
    table.add_row(escape(text), escape(text))
    console.print(table)
    with console.status(escape(text)):
        print(text)
    with Progress(TextColumn("{task.description}"), console=console) as bar:
        bar.update(bar.add_task(escape(text), total=1), completed=1, refresh=True)


@pytest.mark.parametrize("is_terminal", [True, False])
def test_whatever_rich_draws_is_filtered(monkeypatch, is_terminal):
    """Its own colours and movements pass, and nothing else that steers."""
    monkeypatch.setenv("FORCE_COLOR", "1" if is_terminal else "")
    monkeypatch.setenv("COLUMNS", "400")
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("NO_COLOR", "1")
    stream = filtered(monkeypatch)
    draw(Console(), EVIL)
    told = stream.getvalue()
    assert ("\x1b[" in told) == is_terminal
    told = re.sub(r"\x1b\[(\d*m|\?25[lh]|2K|1A)|\r", "", told)
    assert told.count(f"{MARK}[2J{MARK}]0;owned") >= 7
    assert not set(told) & STEERING


def test_no_command_has_a_console_of_its_own():
    """rich's own console, which filters nothing, is made in one module alone."""
    folder = Path(tdac_agent.__file__).parent
    makers = [
        path.name
        for path in folder.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom)
        and node.module in ("rich", "rich.console")
        and {alias.name for alias in node.names} & {"Console", "print", "get_console"}
    ]
    assert makers == []


@pytest.mark.parametrize(
    "words",
    [
        ["verify", f"{EVIL}.py"],
        ["play", f"here/{EVIL}.py", "--video", "x.mp4"],
        ["verify", "x.py", "--task", EVIL],
        ["verify", "x.py", f"--{EVIL}"],
        ["verify", "x.py", "--profile", EVIL],
        ["verify", "x.py", "--seed", EVIL],
        [EVIL],
        ["map", EVIL],
        ["world", EVIL],
        ["synth", "--model", EVIL],
        ["synth", "--resume", EVIL],
        ["rules", EVIL],
        ["report", EVIL],
        ["runs", EVIL],
        ["evaluate", EVIL],
        ["campaign", "run", EVIL],
        ["check-suite", EVIL],
        ["webots", "run", EVIL, EVIL],
    ],
    ids=lambda words: " ".join(words).translate(dict.fromkeys(map(ord, EVIL), "!")),
)
def test_no_word_of_a_command_line_steers_the_terminal(tdac, words):
    """Names of files, options, values and commands are told, and filtered."""
    code, out, err = tdac(*words)
    assert code in (0, 1, 2)
    assert not set(out + err) & STEERING
    assert len(err.splitlines()) <= 2


def test_a_process_on_a_terminal(tmp_path):
    """The whole program, its streams a real terminal."""
    master, slave = pty.openpty()
    with os.fdopen(slave) as terminal, os.fdopen(master, "rb") as screen:
        process = subprocess.run(
            [sys.executable, "-m", "tdac_agent", "verify", f"{EVIL}.py"],
            stdin=subprocess.DEVNULL,
            stdout=terminal,
            stderr=terminal,
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": os.getcwd(), "COLUMNS": "300"},
            check=False,
        )
        told = os.read(screen.fileno(), 1 << 16).decode()
    assert process.returncode == 2
    assert "error: no controller" in told
    told = told.replace("\x1b[2K", "", 1)
    assert not set(told) & STEERING


NAMES_OF_ITS_OWN = """
import functools


def policy(obs):
    modules = functools.__spec__.loader.load_module.__globals__["sys"].modules
    for module in list(modules.values()):
        if hasattr(module, "type_name"):
            module.type_name = lambda value: "\\ud800\\x1b[2J\\nverified: 41 of 41"
    return object()
"""


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["map", "world"])
def test_a_name_that_nothing_can_print_is_no_fault_of_ours(tdac, tmp_path, kind):
    """The controller has failed, in every command that runs it."""
    place = {"map": write_small_task(tmp_path / "t"), "world": "epuck"}[kind]
    evil = tmp_path / "evil.py"
    evil.write_text(NAMES_OF_ITS_OWN)
    for expected, command, *flags in (
        (1, "verify", "--profile", "policy"),
        (1, "play", "--video", "a.gif"),
        (1, "evaluate", "--episodes", "2"),
    ):
        code, out, err = tdac(command, evil, "--task", place, *flags)
        assert (code, err) == (expected, "")
        assert not set(out) & STEERING
        assert command == "evaluate" or "misused the judge's channel" in out
        assert not re.search(r"^\s*verified", out, re.MULTILINE)
