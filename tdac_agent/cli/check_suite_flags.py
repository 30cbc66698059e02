"""The command `tdac check-suite`."""

from __future__ import annotations

from typing import Annotated

import typer

from tdac_agent.cli.mistakes import begun
from tdac_agent.cli.options import (
    JitterSeed,
    Json,
    Profile,
    Suite,
    Tier,
    Trust,
    number_flag,
)
from tdac_agent.cli.task_flags import NamedTask, takes_task

app = typer.Typer()


@app.command(
    "check-suite", epilog="Example: `tdac check-suite --task office --suite my_tests`"
)
@takes_task()
def check_suite(
    named_task: NamedTask,
    suite: Suite = None,
    trust: Trust = False,
    profile: Profile = None,
    tier: Tier = "auto",
    seed: JitterSeed = None,
    repeats: Annotated[
        int, number_flag(min=1, help="Verifications per controller; they must agree.")
    ] = 5,
    as_json: Json = False,
) -> None:
    """Check that a suite passes a good controller and fails bad ones."""
    with begun():
        from tdac_agent.cli import check_suite as command

    raise typer.Exit(
        command.run(named_task(), profile, suite, trust, tier, seed, repeats, as_json)
    )
