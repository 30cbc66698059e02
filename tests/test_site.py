"""Commands in README and docs: the command line accepts each of them as it stands."""

import re
import shlex
from pathlib import Path

import pytest
import typer

from tdac_agent.cli.coordinates import with_coordinates
from tdac_agent.cli.main import command_line

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def commands(page):
    """The lines of a page that begin with `tdac`."""
    for language, block in BLOCK.findall(page.read_text()):
        if language not in ("", "bash"):
            continue
        for line in block.replace("\\\n", " ").splitlines():
            text = line.removeprefix("$ ").strip()
            if text.startswith("tdac ") and not text.startswith("tdac: "):
                yield text


CASES = [(page, line) for page in PAGES for line in commands(page)]


def test_there_are_commands():
    """The pages are found, and so are their commands."""
    assert len(CASES) > 60
    assert {page.name for page, _ in CASES} >= {"README.md", "first-steps.md"}


@pytest.mark.parametrize(
    ("page", "line"), CASES, ids=[f"{p.stem}:{line[:50]}" for p, line in CASES]
)
def test_a_command_is_accepted(page, line, monkeypatch, tmp_path):
    """Its flags exist, and their values are of the right kind."""
    monkeypatch.chdir(tmp_path)
    words = with_coordinates(shlex.split(line, comments=True)[1:])
    command = typer.main.get_command(command_line(words))
    context = command.make_context("tdac", words)
    while context._protected_args:
        words = [*context._protected_args, *context.args]
        name, command, words = command.resolve_command(context, words)
        context = command.make_context(name, words, parent=context)
    assert context.parent is not None
