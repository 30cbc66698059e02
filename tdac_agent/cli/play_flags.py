"""The command `tdac play`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

from tdac_agent.cli.options import (
    VIDEO,
    AxleError,
    Controller,
    Delay,
    MotorLag,
    RangeDropout,
    RangeNoise,
    Speed,
    Tier,
    WheelGains,
    WheelSlip,
    file_flag,
    number_flag,
)
from tdac_agent.cli.task_flags import NamedTask, takes_task

app = typer.Typer()


@app.command(
    epilog="Examples: `tdac play runs/maze-1 --video maze.mp4`; "
    "`tdac play runs/maze-1 --seed 17`; "
    "`tdac play builtin --set unknown --index 3 --video unknown.gif`"
)
@takes_task()
def play(
    controller: Controller,
    named_task: NamedTask,
    video: Annotated[
        Optional[Path],  # noqa: UP045 - typer reads it at run time
        file_flag(help=f"{VIDEO} instead of opening a window."),
    ] = None,
    speed: Speed = None,
    episode: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            metavar="NAME",
            help="Episode of the suite, as `tdac verify` runs it without --seed: "
            "`nominal`, `jitter 1`, …  [default: nominal]",
        ),
    ] = None,
    seed: Annotated[
        Optional[int],  # noqa: UP045
        number_flag(
            min=0, help="Play the episode of `tdac verify --robust` with this seed."
        ),
    ] = None,
    tier: Tier = "auto",
    range_noise: RangeNoise = None,
    wheel_slip: WheelSlip = None,
    motor_lag: MotorLag = None,
    delay: Delay = None,
    wheel_gains: WheelGains = None,
    axle_error: AxleError = None,
    range_dropout: RangeDropout = None,
    set_name: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            "--set",
            metavar="NAME",
            help="Task set (`tdac sets`) or set.yaml: play a world of it; the policy "
            "may also be builtin or a .zip of stable-baselines3.",
            rich_help_panel="Task set",
        ),
    ] = None,
    index: Annotated[
        Optional[int],  # noqa: UP045
        number_flag(
            "--index",
            min=0,
            help="Number of the world.  [default: 0]",
            rich_help_panel="Task set",
        ),
    ] = None,
    split: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            metavar="NAME",
            help="train, dev or test.  [default: dev]",
            rich_help_panel="Task set",
        ),
    ] = None,
) -> None:
    """Show one episode of a controller, run in the sandbox.

    The episode is one of `tdac verify`, or with --seed one of `tdac verify --robust`,
    or with --set one of `tdac verify --set`.
    """
    from tdac_agent.cli.set_flags import check_set, task_words

    single = {
        **task_words(named_task()),
        "--episode": episode,
        "--seed": seed,
        "--range-noise": range_noise,
        "--wheel-slip": wheel_slip,
        "--motor-lag": motor_lag,
        "--delay": delay,
        "--wheel-gains": wheel_gains,
        "--axle-error": axle_error,
        "--range-dropout": range_dropout,
    }
    check_set(set_name, {"--index": index, "--split": split}, single)
    if set_name is not None:
        from tdac_agent.cli import play_set

        raise typer.Exit(
            play_set.run(
                controller, set_name, split or "dev", index or 0, video, speed, tier
            )
        )
    from tdac_agent.cli import play as command
    from tdac_agent.cli.robust_flags import DisturbanceFlags

    disturbed = DisturbanceFlags(
        range_noise=range_noise,
        wheel_slip=wheel_slip,
        motor_lag=motor_lag,
        delay=delay,
        wheel_gains=wheel_gains,
        axle_error=axle_error,
        range_dropout=range_dropout,
    )
    raise typer.Exit(
        command.run(
            controller, named_task(), video, speed, episode, seed, disturbed, tier
        )
    )
