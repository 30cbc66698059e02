"""The command `tdac train`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import typer

from tdac_agent.cli.shared_options import (
    AXLE_ERROR,
    DELAY,
    HEADING_NOISE,
    MESSAGE_DROP,
    MOTOR_LAG,
    POSE_CORRELATION,
    POSE_DELAY,
    POSE_JUMPS,
    POSE_NOISE,
    RANGE_DROPOUT,
    RANGE_NOISE,
    SCAN_DELAY,
    VARIATION,
    WHEEL_GAINS,
    WHEEL_RADII,
    WHEEL_SLIP,
    WRAPPER,
    Variation,
    json_option,
    out_option,
    trust_option,
    wrappers_option,
)
from tdac_agent.cli.task_flags import SET, TASK
from tdac_agent.cli.typed_options import typed_options
from tdac_agent.option_fields import option

app = typer.Typer()
TRAINING, DISTURBED = "Training", "Variation and noise"


@dataclass(frozen=True, slots=True)
class TrainOptions:
    """The flags of `tdac train`."""

    files: tuple[str, ...] = option(
        (),
        "Tasks or a task set; the same as --task or --set.",
        argument=True,
        metavar="FILE...",
    )
    tasks: tuple[str, ...] = option(
        (),
        f"{TASK}; repeatable, for several maps or several worlds.  [default: maze]",
        "--task",
        metavar="PATH",
        scope="task",
    )
    set_name: str | None = option(
        None,
        f"{SET}, instead of tasks: train on its worlds of the split train, and "
        "evaluate on those of dev.",
        "--set",
        metavar="NAME",
    )
    algo: Literal["ppo", "recurrent-ppo", "sac", "td3"] = option(
        "ppo", "Algorithm of stable-baselines3."
    )
    steps: int | None = option(
        None,
        "Training steps of all robots together.  [default: from --config]",
        least=1,
    )
    seed: int = option(0, "Seed of networks, starts and noise.", least=0)
    seeds: int | None = option(
        None,
        "Train with so many seeds, from --seed on, side by side on all cores; each has "
        "a folder seed-N.",
        least=1,
        most=100,
    )
    out: Path | None = out_option("Training folder.  [default: runs/ALGO-NAME-N]")
    resume: Path | None = out_option(
        "Continue the training in this folder with its own settings, from its last "
        "checkpoint; --steps changes its length."
    )
    trust: bool = trust_option()
    as_json: bool = json_option()
    wrappers: tuple[str, ...] | None = wrappers_option(
        f"{WRAPPER}  [default: from --config]", "--wrapper", panel=TRAINING
    )
    uses: Literal["rays", "memory", "planner"] = option(
        "rays",
        "What the policy uses besides goal and wheels: its rays; also a map of what "
        "they have shown; or points on the way that is found on this map.",
        panel=TRAINING,
        scope="set",
    )
    from_policy: Path | None = option(
        None,
        "Begin with the weights of this policy, a .zip of stable-baselines3 with the "
        "same network and wrappers.",
        "--from",
        metavar="FILE",
        panel=TRAINING,
    )
    n_envs: int | None = option(
        None,
        "Number of robots driven in parallel.  [default: from --config]",
        least=1,
        panel=TRAINING,
    )
    episodes: int | None = option(
        None,
        "Episodes per evaluation, or worlds.  [default: 100]",
        least=1,
        panel=TRAINING,
    )
    config: Path | None = option(
        None,
        "Hyperparameters in rl-zoo3 format.  [default: bundled, by --algo]",
        metavar="FILE",
        panel=TRAINING,
    )
    variation: Variation | None = option(
        None,
        f"{VARIATION}  [default: from --config for training, jitter for evaluations]",
        panel=DISTURBED,
        scope="task",
    )
    range_noise: float = option(0.0, RANGE_NOISE, panel=DISTURBED, scope="task")
    wheel_slip: float = option(0.0, WHEEL_SLIP, panel=DISTURBED, scope="task")
    motor_lag: float = option(0.0, MOTOR_LAG, panel=DISTURBED, scope="task")
    delay: int = option(0, DELAY, panel=DISTURBED, scope="task")
    wheel_gains: float = option(0.0, WHEEL_GAINS, panel=DISTURBED, scope="task")
    axle_error: float = option(0.0, AXLE_ERROR, panel=DISTURBED, scope="task")
    range_dropout: float = option(0.0, RANGE_DROPOUT, panel=DISTURBED, scope="task")
    wheel_radius_error: float = option(0.0, WHEEL_RADII, panel=DISTURBED, scope="task")
    pose_noise: float = option(0.0, POSE_NOISE, panel=DISTURBED, scope="task")
    heading_noise: float = option(0.0, HEADING_NOISE, panel=DISTURBED, scope="task")
    pose_correlation: float = option(
        0.0, POSE_CORRELATION, panel=DISTURBED, scope="task"
    )
    pose_jumps: float = option(0.0, POSE_JUMPS, panel=DISTURBED, scope="task")
    pose_delay: int = option(0, POSE_DELAY, panel=DISTURBED, scope="task")
    scan_delay: int = option(0, SCAN_DELAY, panel=DISTURBED, scope="task")
    message_drop: float = option(0.0, MESSAGE_DROP, panel=DISTURBED, scope="task")


@app.command(
    epilog="Examples: `tdac train --task maze`; `tdac train --task epuck --algo sac "
    "--seed 1`; `tdac train --task maze --task office --variation random`; "
    "`tdac train --set unknown --seeds 5`"
)
@typed_options("train:run")
def train(options: TrainOptions) -> None:
    """Train a baseline policy with stable-baselines3 on tasks or a task set."""
