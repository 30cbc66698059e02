"""The command `tdac check-suite`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import typer

from tdac_agent.cli.shared_options import (
    Profile,
    json_option,
    profile_option,
    seed_option,
    suite_option,
    tier_option,
    trust_option,
)
from tdac_agent.cli.task_flags import ONLY_FOR_SYNTH, TaskFlags
from tdac_agent.cli.typed_options import typed_options
from tdac_agent.option_fields import option

app = typer.Typer()


@dataclass(frozen=True, slots=True)
class CheckSuiteOptions:
    """The further flags of `tdac check-suite`."""

    suite: Path | None = suite_option()
    trust: bool = trust_option()
    profile: Profile | None = profile_option()
    tier: str = tier_option()
    seed: int | None = seed_option()
    repeats: int = option(5, "Verifications per controller; they must agree.", least=1)
    as_json: bool = json_option()


@app.command(
    "check-suite", epilog="Example: `tdac check-suite --task office --suite my_tests`"
)
@typed_options("check_suite:run", without=(*ONLY_FOR_SYNTH, "set_name"))
def check_suite(flags: TaskFlags, options: CheckSuiteOptions) -> None:
    """Check that a suite passes a good controller and fails bad ones."""
