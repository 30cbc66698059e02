"""The commands `tdac demo | rules | report | runs`: runs on record."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

from tdac_agent.cli.options import Json

app = typer.Typer()


@app.command(epilog="Example: `tdac demo`")
def demo(
    out: Annotated[
        Path | None, typer.Option(help="Run folder [default: runs/demo-N].")
    ] = None,
    as_json: Json = False,
) -> None:
    """Replay a recorded run of a language model: its answers, your machine's tests."""
    from tdac_agent.cli import demo as command

    raise typer.Exit(command.run(out, as_json))


@app.command("rules", epilog="Example: `tdac rules runs/office-1`")
def rules_command(
    run: Annotated[Path, typer.Argument(help="A run folder.")], as_json: Json = False
) -> None:
    """Show what a run has learnt: each rule, where it came from, what came of it."""
    from tdac_agent.cli import rules

    raise typer.Exit(rules.run(run, as_json))


@app.command(
    "report",
    epilog="Examples: `tdac report runs/office-1`; `tdac report runs --out all.html`",
)
def report_command(
    place: Annotated[Path, typer.Argument(help="A run folder, or a folder of runs.")],
    out: Annotated[
        Optional[Path],  # noqa: UP045 - typer reads it at run time
        typer.Option("--out", help="The file.  [default: report.html in the folder]"),
    ] = None,
) -> None:
    """Make one HTML file of runs: verdicts, failures, code, rules, animations."""
    from tdac_agent.cli import report

    raise typer.Exit(report.run(place, out))


@app.command("runs", epilog="Examples: `tdac runs`; `tdac runs results --json`")
def runs_command(
    folder: Annotated[Path, typer.Argument(help="Where the run folders are.")] = Path(
        "runs"
    ),
    as_json: Json = False,
) -> None:
    """List runs and trainings: how far each came, what it took, how to go on."""
    from tdac_agent.cli import runs

    raise typer.Exit(runs.run(folder, as_json))
