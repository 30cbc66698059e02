"""The command `tdac train`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Optional

import typer

from tdac_agent.cli.options import (
    AXLE_ERROR,
    DELAY,
    MOTOR_LAG,
    RANGE_DROPOUT,
    RANGE_NOISE,
    TASK,
    VARIATION,
    WHEEL_GAINS,
    WHEEL_SLIP,
    WRAPPER,
    Json,
    Trust,
    dir_flag,
    file_flag,
    number_flag,
)

app = typer.Typer()
TRAINING, DISTURBED = "Training", "Variation and noise"


@app.command(
    epilog="Examples: `tdac train --task maze`; `tdac train --task epuck --algo sac "
    "--seed 1`; `tdac train --task maze --task office --variation random`; "
    "`tdac train --set unknown --steps 100000`"
)
def train(
    tasks: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(
            "--task",
            metavar="PATH",
            help=f"{TASK}; repeatable, for several maps or several worlds.  "
            "[default: maze]",
        ),
    ] = None,
    set_name: Annotated[
        Optional[str],  # noqa: UP045
        typer.Option(
            "--set",
            metavar="NAME",
            help="Task set (`tdac sets`) or set.yaml, instead of tasks: train on its "
            "worlds of the split train, and evaluate on those of dev.",
        ),
    ] = None,
    algo: Annotated[
        Optional[Literal["ppo", "recurrent-ppo", "sac", "td3"]],  # noqa: UP045
        typer.Option(help="Algorithm of stable-baselines3.  [default: ppo]"),
    ] = None,
    steps: Annotated[
        Optional[int],  # noqa: UP045
        number_flag(
            min=1,
            help="Training steps of all robots together.  [default: from --config]",
        ),
    ] = None,
    seed: Annotated[
        Optional[int],  # noqa: UP045
        number_flag(min=0, help="Seed of networks, starts and noise.  [default: 0]"),
    ] = None,
    out: Annotated[
        Optional[Path],  # noqa: UP045
        dir_flag("--out", help="Training folder.  [default: runs/ALGO-NAME-N]"),
    ] = None,
    resume: Annotated[
        Optional[Path],  # noqa: UP045
        dir_flag(
            "--resume",
            help="Continue the training in this folder with its own settings, from its "
            "last checkpoint; --steps changes its length.",
        ),
    ] = None,
    wrappers: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(
            "--wrapper",
            metavar="NAME",
            help=f"{WRAPPER}  [default: from --config]",
            rich_help_panel=TRAINING,
        ),
    ] = None,
    n_envs: Annotated[
        Optional[int],  # noqa: UP045
        number_flag(
            min=1,
            help="Number of robots driven in parallel.  [default: from --config]",
            rich_help_panel=TRAINING,
        ),
    ] = None,
    episodes: Annotated[
        Optional[int],  # noqa: UP045
        number_flag(
            min=1,
            help="Episodes per evaluation, or worlds.  [default: 100]",
            rich_help_panel=TRAINING,
        ),
    ] = None,
    config: Annotated[
        Optional[Path],  # noqa: UP045
        file_flag(
            help="Hyperparameters in rl-zoo3 format.  [default: bundled, by --algo]",
            rich_help_panel=TRAINING,
        ),
    ] = None,
    variation: Annotated[
        Optional[Literal["nominal", "jitter", "mixed", "random"]],  # noqa: UP045
        typer.Option(
            help=f"{VARIATION}  [default: from --config for training, jitter for "
            "evaluations]",
            rich_help_panel=DISTURBED,
        ),
    ] = None,
    range_noise: Annotated[
        Optional[float],  # noqa: UP045
        number_flag(help=f"{RANGE_NOISE}  [default: 0]", rich_help_panel=DISTURBED),
    ] = None,
    wheel_slip: Annotated[
        Optional[float],  # noqa: UP045
        number_flag(help=f"{WHEEL_SLIP}  [default: 0]", rich_help_panel=DISTURBED),
    ] = None,
    motor_lag: Annotated[
        Optional[float],  # noqa: UP045
        number_flag(help=f"{MOTOR_LAG}  [default: 0]", rich_help_panel=DISTURBED),
    ] = None,
    delay: Annotated[
        Optional[int],  # noqa: UP045
        number_flag(help=f"{DELAY}  [default: 0]", rich_help_panel=DISTURBED),
    ] = None,
    wheel_gains: Annotated[
        Optional[float],  # noqa: UP045
        number_flag(help=f"{WHEEL_GAINS}  [default: 0]", rich_help_panel=DISTURBED),
    ] = None,
    axle_error: Annotated[
        Optional[float],  # noqa: UP045
        number_flag(help=f"{AXLE_ERROR}  [default: 0]", rich_help_panel=DISTURBED),
    ] = None,
    range_dropout: Annotated[
        Optional[float],  # noqa: UP045
        number_flag(help=f"{RANGE_DROPOUT}  [default: 0]", rich_help_panel=DISTURBED),
    ] = None,
    trust: Trust = False,
    as_json: Json = False,
) -> None:
    """Train a baseline policy with stable-baselines3 on tasks or a task set."""
    from tdac_agent.cli import train as command

    noise = {
        "range_noise": range_noise,
        "wheel_slip": wheel_slip,
        "motor_lag": motor_lag,
        "delay": delay,
        "wheel_gains": wheel_gains,
        "axle_error": axle_error,
        "range_dropout": range_dropout,
    }
    given = {
        "task": tasks,
        "set": set_name,
        "algo": algo,
        "seed": seed,
        "wrapper": wrappers,
        "n_envs": n_envs,
        "episodes": episodes,
        "config": config,
        "variation": variation,
        **noise,
    }
    flags = {name: value for name, value in given.items() if value is not None}
    raise typer.Exit(command.run(flags, steps, out, resume, trust, as_json))
