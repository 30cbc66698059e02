"""The progress bar of policies that drive one after the other."""

from __future__ import annotations

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from tdac_agent.cli.console import Console


def policy_bar(console: Console) -> Progress:
    """A bar whose tasks have the fields `doing` and `successes`."""
    # Redrawn only on updates: a timer would cost CPU time.
    return Progress(
        TextColumn("{task.fields[doing]}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[successes]} reached"),
        console=console,
        transient=True,
        auto_refresh=False,
        disable=not console.is_terminal,
    )
