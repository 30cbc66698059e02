"""The command `tdac play`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import typer

from tdac_agent.cli.shared_options import (
    CONTROLLER,
    VIDEO,
    NoiseFlags,
    speed_option,
    tier_option,
)
from tdac_agent.cli.task_flags import ONLY_FOR_SYNTH, SETS, TaskFlags
from tdac_agent.cli.typed_options import typed_options
from tdac_agent.option_fields import option

app = typer.Typer()


@dataclass(frozen=True, slots=True)
class PlayOptions:
    """The further flags of `tdac play`."""

    controller: str = option(
        ...,
        f"{CONTROLLER} On a task set also `builtin`, a classical planner of `tdac "
        "bench`, or a .zip of stable-baselines3.",
        argument=True,
    )
    video: Path | None = option(
        None, f"{VIDEO} instead of opening a window.", metavar="FILE"
    )
    mcap: Path | None = option(
        None,
        "Write a .mcap file with ROS 2 messages (scan, pose, path, map, contacts) "
        "instead of opening a window.",
        metavar="FILE",
        scope="task",
    )
    speed: float | None = speed_option()
    view: Literal["2d", "3d"] = option(
        "2d",
        "3d shows the robot from behind and the whole scene from above, rendered by "
        "MuJoCo (extra `physics`).",
        metavar="2d|3d",
    )
    episode: str | None = option(
        None,
        "Episode of the suite, as `tdac verify` runs it without --seed: `nominal`, "
        "`jitter 1`, …  [default: nominal]",
        metavar="NAME",
        scope="task",
    )
    seed: int | None = option(
        None,
        "Play the episode of `tdac verify --robust` with this seed.",
        least=0,
        scope="task",
    )
    deviation: str | None = option(
        None,
        "Let the robot or world differ from what the controller is told, as `tdac "
        "falsify` prints it: `delay=3,pose_x=0.1`; lengths in body radii.",
        metavar="NAME=VALUE,…",
    )
    tier: str = tier_option()
    index: int = option(0, "Number of the world.", least=0, panel=SETS, scope="set")
    split: str = option(
        "dev", "train, dev or test.", metavar="NAME", panel=SETS, scope="set"
    )


@app.command(
    epilog="Examples: `tdac play runs/maze-1 --video maze.mp4`; "
    "`tdac play runs/epuck-1 --view 3d --video epuck.mp4`; "
    "`tdac play runs/maze-1 --seed 17`; `tdac play runs/maze-1 --goal 178 386`; "
    "`tdac play builtin --set unknown --index 3 --video unknown.gif`"
)
@typed_options("play:run", without=ONLY_FOR_SYNTH)
def play(options: PlayOptions, flags: TaskFlags, noise: NoiseFlags) -> None:
    """Show one episode of a controller, run in the sandbox.

    The episode is one of `tdac verify`, or with --seed one of `tdac verify --robust`,
    or with --set one of `tdac verify --set`.
    """
