"""`tdac report`: writes one HTML file about runs."""

from __future__ import annotations

from pathlib import Path

from rich.markup import escape

from tdac_agent.cli.console import Console
from tdac_agent.cli.sentences import print_sentences
from tdac_agent.errors import RunError
from tdac_agent.html_report import make_page
from tdac_agent.storage.files import write_atomic

DEFAULT = "report.html"


def run(place: Path, out: Path | None) -> int:
    """Writes the report and returns the exit code.

    Raises:
        RunError: No run can be read, or the file cannot be written.
    """
    file = out or place / DEFAULT
    # `make_page` reports a missing place.
    if place.exists() and (file.is_dir() or not file.resolve().parent.is_dir()):
        reason = "it is a folder" if file.is_dir() else "there is no such folder"
        raise RunError(f"cannot write {file}: {reason}")
    page = make_page(place)
    try:
        write_atomic(file, page.html)
    except OSError as error:
        raise RunError(f"cannot write {file}: {error.strerror}") from error
    console = Console()
    for line in page.unreadable:
        print_sentences(console, f"not readable: {line}", "yellow")
    runs = "1 run" if page.runs == 1 else f"{page.runs} runs"
    summary = f"{escape(str(file))}: {runs}, {page.verified} verified"
    console.print(f"{summary}; {len(page.html) / 1e6:.1f} MB", soft_wrap=True)
    return 0
