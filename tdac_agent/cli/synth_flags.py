"""The command `tdac synth`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import typer

from tdac_agent.cli.shared_options import (
    Profile,
    json_option,
    out_option,
    profile_option,
    trust_option,
)
from tdac_agent.cli.task_flags import TaskFlags
from tdac_agent.cli.typed_options import typed_options
from tdac_agent.option_fields import option
from tdac_agent.synthesis.options import SynthOptions

app = typer.Typer()


@dataclass(frozen=True, slots=True)
class RunFlags:
    """The flags of `tdac synth` about the run as a whole."""

    profile: Profile | None = profile_option()
    out: Path | None = out_option(
        "Run folder; an unfinished run of the same command in it is continued.  "
        "[default: runs/TASK-N]"
    )
    resume: Path | None = out_option(
        "Continue the run in this folder with its own settings."
    )
    dry_run: bool = option(
        False, "Print the first prompt and the maximum cost; ask no model."
    )
    trust: bool = trust_option()
    as_json: bool = json_option()


@app.command(
    epilog="Examples: `tdac synth`; `tdac synth plan.png --start 90 302 "
    "--goal 178 386 --radius 12`; "
    "`tdac synth --learner anthropic:claude-sonnet-5-5`; "
    "`tdac synth --set known`; `tdac synth --resume runs/maze-1`"
)
@typed_options("synth:run")
def synth(
    context: typer.Context,
    flags: TaskFlags,
    options: SynthOptions,
    run_flags: RunFlags,
) -> None:
    """Write, test and repair a controller until it is verified.

    It must pass all tests, and then drive blind: from about a hundred disturbed starts,
    of which one may fail.

    With --set, it is written for worlds that it has never seen: the best one on worlds
    of the split dev is selected.
    """
