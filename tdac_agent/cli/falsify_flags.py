"""The command `tdac falsify`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import typer

from tdac_agent.cli.shared_options import (
    json_option,
    out_option,
    physics_option,
    tier_option,
)
from tdac_agent.cli.task_flags import ONLY_FOR_SYNTH, SETS, TaskFlags
from tdac_agent.cli.typed_options import typed_options
from tdac_agent.option_fields import option
from tdac_agent.synthesis.options import Engine

app = typer.Typer()


@dataclass(frozen=True, slots=True)
class FalsifyOptions:
    """The further flags of `tdac falsify`."""

    policy: str = option(
        ...,
        "Controller file, or run folder, which brings its own task or set; a .zip of "
        "stable-baselines3, `builtin`, or a classical planner.",
        argument=True,
    )
    episodes: int = option(
        256,
        "Most episodes of the search.",
        "-n",
        "--episodes",
        least=16,
        most=1_000_000,
    )
    seed: int = option(0, "Seed of the search and of its episodes.", least=0)
    space: str | None = option(
        None,
        "Deviations to search, separated by commas, with a size or the usual one, as "
        "in `delay,axle=0.02`.  [default: all]",
        metavar="NAME[=SIZE],…",
    )
    curves: int = option(
        0,
        "Also drive so many jittered starts (on a set, worlds) at each of up to six "
        "sizes of each deviation, for curves of success.",
        least=0,
        most=10_000,
    )
    out: Path | None = out_option(
        "Folder for falsify.json, counterexample.png, and curves.png."
    )
    physics: Engine = physics_option()
    tier: str = tier_option()
    as_json: bool = json_option()
    worlds: int = option(
        4,
        "Worlds of the set, which share the episodes.",
        least=1,
        panel=SETS,
        scope="set",
    )
    split: str = option("dev", "dev or test.", metavar="NAME", panel=SETS, scope="set")


@app.command(
    epilog="Examples: `tdac falsify runs/maze-1`; `tdac falsify mine.py --task epuck "
    "-n 512 --out falsified`; `tdac falsify runs/maze-1 --space delay,axle=0.02`; "
    "`tdac falsify ppo.zip --set unknown`"
)
@typed_options("falsify:run", without=ONLY_FOR_SYNTH)
def falsify(options: FalsifyOptions, flags: TaskFlags) -> None:
    """Search for the smallest deviation with which a policy fails.

    A deviation is a robot or world that differs from what the controller is told: a
    shifted start, another axle, a late action, a wrong pose. It is a search, not a
    proof: there may be smaller failures.
    """
