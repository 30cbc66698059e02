"""Flags of `tdac train`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Optional

import typer

from tdac_agent.cli.options import Json, Trust

app = typer.Typer()
TRAINING, DISTURBED = "Training", "Variation and noise"


@app.command(
    epilog="Examples: `tdac train --task maze`; `tdac train --task epuck --algo sac "
    "--seed 1`; `tdac train --task maze --task office --variation random`"
)
def train(
    tasks: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(
            "--task",
            help="Bundled name, task.yaml, or run folder; repeatable: a set of maps, "
            "or of worlds.  [default: maze]",
        ),
    ] = None,
    algo: Annotated[
        Optional[Literal["ppo", "sac", "td3"]],  # noqa: UP045
        typer.Option(help="Of stable-baselines3.  [default: ppo]"),
    ] = None,
    steps: Annotated[
        Optional[int],  # noqa: UP045
        typer.Option(
            min=1, help="Of all robots together.  [default: the hyperparameters']"
        ),
    ] = None,
    seed: Annotated[
        Optional[int],  # noqa: UP045
        typer.Option(min=0, help="Of networks, starts and noise.  [default: 0]"),
    ] = None,
    out: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option("--out", metavar="DIR", help="[default: runs/ALGO-TASK-N]"),
    ] = None,
    resume: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(
            "--resume",
            metavar="DIR",
            help="Go on with a training as it was begun, from its last checkpoint; "
            "with --steps to another end.",
        ),
    ] = None,
    wrappers: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(
            "--wrapper",
            metavar="NAME",
            help="What the policy sees, innermost first; repeatable: `goal-relative`, "
            "`guidance`, `flatten`, or `none`.  [default: these three]",
            rich_help_panel=TRAINING,
        ),
    ] = None,
    n_envs: Annotated[
        Optional[int],  # noqa: UP045
        typer.Option(
            min=1,
            help="Robots that are driven at a time.",
            rich_help_panel=TRAINING,
        ),
    ] = None,
    episodes: Annotated[
        Optional[int],  # noqa: UP045
        typer.Option(
            min=1,
            help="Of each of the evaluations.  [default: 100]",
            rich_help_panel=TRAINING,
        ),
    ] = None,
    config: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(
            help="Hyperparameters, in the form of rl-zoo3.",
            rich_help_panel=TRAINING,
        ),
    ] = None,
    variation: Annotated[
        Optional[Literal["nominal", "jitter", "mixed", "random"]],  # noqa: UP045
        typer.Option(
            help="Starts: the task's own, within a body radius of it, mixed with "
            "any start, or any start and goal.  [default: mixed to train, jitter to "
            "evaluate]",
            rich_help_panel=DISTURBED,
        ),
    ] = None,
    range_noise: Annotated[
        Optional[float],  # noqa: UP045
        typer.Option(
            help="Of each range, relative.  [default: 0]", rich_help_panel=DISTURBED
        ),
    ] = None,
    wheel_slip: Annotated[
        Optional[float],  # noqa: UP045
        typer.Option(
            help="Of each wheel's speed, relative.  [default: 0]",
            rich_help_panel=DISTURBED,
        ),
    ] = None,
    motor_lag: Annotated[
        Optional[float],  # noqa: UP045
        typer.Option(
            help="Time constant of the wheels, s.  [default: 0]",
            rich_help_panel=DISTURBED,
        ),
    ] = None,
    delay: Annotated[
        Optional[int],  # noqa: UP045
        typer.Option(
            help="Steps by which an action is late.  [default: 0]",
            rich_help_panel=DISTURBED,
        ),
    ] = None,
    trust: Trust = False,
    as_json: Json = False,
) -> None:
    """Train a baseline with stable-baselines3 on the same tasks."""
    from tdac_agent.cli import train as command

    noise = {
        "range_noise": range_noise,
        "wheel_slip": wheel_slip,
        "motor_lag": motor_lag,
        "delay": delay,
    }
    given = {
        "task": tasks,
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
