"""The commands `tdac demo`, `rules`, `report` and `runs`, about recorded runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tdac_agent.cli.shared_options import Json

app = typer.Typer()
RUNS = "Run folder, folder of runs, or campaign; subfolders are searched."


@app.command(epilog="Example: `tdac demo`")
def demo(
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Run folder.  [default: runs/demo-N]"),
    ] = None,
    as_json: Json = False,
) -> int:
    """Replay a recorded run of a language model, with live tests."""
    from tdac_agent.cli import demo as command

    return command.run(out, as_json)


rules_app = typer.Typer(
    no_args_is_help=True,
    help="Show the repair rules of a run, or write rules for other runs.",
)
app.add_typer(rules_app, name="rules")


@rules_app.command("show", epilog="Example: `tdac rules runs/office-1`")
def show_rules(
    run: Annotated[Path, typer.Argument(help="Run folder.")], as_json: Json = False
) -> int:
    """Show the rules of a run, with origin and effect; `show` may be left out."""
    from tdac_agent.cli import rules

    return rules.run(run, as_json)


@rules_app.command(
    "export",
    epilog="Example: `tdac rules export runs/maze-1 runs/office-1 --out rules.md`, "
    "then `tdac synth --rules rules.md`",
)
def export_rules(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN...", help="Run folders.")],
    out: Annotated[Path, typer.Option(metavar="FILE", help="Output file.")] = Path(
        "rules.md"
    ),
) -> int:
    """Write the rules of runs that can help on other tasks, the most useful first."""
    from tdac_agent.cli import rules

    return rules.export(runs, out)


@app.command(
    "report",
    epilog="Examples: `tdac report runs/office-1`; `tdac report runs --out all.html`",
)
def report_command(
    place: Annotated[
        Path, typer.Argument(metavar="DIR", help="Run folder, or folder of runs.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Output file.  [default: DIR/report.html]"),
    ] = None,
) -> int:
    """Write an HTML report of runs: failures, code, rules, animations."""
    from tdac_agent.cli import report

    return report.run(place, out)


@app.command("runs", epilog="Examples: `tdac runs`; `tdac runs results --json`")
def runs_command(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help=RUNS)] = Path("runs"),
    as_json: Json = False,
) -> int:
    """List runs and trainings: progress, cost, how to continue them."""
    from tdac_agent.cli import runs

    return runs.run(folder, as_json)
