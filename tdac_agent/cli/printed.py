"""Shows what a controller printed."""

from __future__ import annotations

import re
from collections import Counter

from rich.text import Text

from tdac_agent.cli.console import Console
from tdac_agent.storage.plain import printable

# A line that a controller prints more often than this is shown once, with its count.
REPEATS = 5
_CONTROL_SEQUENCES = re.compile(r"\x1b\[[0-?]*[ -/]*[@-~]|\r")


def show_printed(text: str, console: Console) -> None:
    """Prints a controller's output, if any, without control sequences."""
    if text.strip():
        console.print("[cyan]the controller printed[/]")
        output = printable(_CONTROL_SEQUENCES.sub("", text))
        console.print(Text(_without_repeats(output)), soft_wrap=True)


def _without_repeats(text: str) -> str:
    """The text, in which a frequent line occurs once, followed by its count."""
    lines = text.rstrip().splitlines()
    counts = Counter(lines)
    kept: list[str] = []
    seen: set[str] = set()
    for line in lines:
        if counts[line] <= REPEATS or not line.strip():
            kept.append(line)
        elif line not in seen:
            kept.append(f"{line}  (×{counts[line]})")
        seen.add(line)
    return "\n".join(kept)
