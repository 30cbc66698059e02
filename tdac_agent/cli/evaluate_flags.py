"""The command `tdac evaluate`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import typer

from tdac_agent.cli.shared_options import (
    VARIATION,
    WRAPPER,
    Variation,
    json_option,
    out_option,
    physics_option,
    tier_option,
    wrappers_option,
)
from tdac_agent.cli.task_flags import ONLY_FOR_SYNTH, SETS, TASK, TASKS, TaskFlags
from tdac_agent.cli.typed_options import typed_options
from tdac_agent.option_fields import option
from tdac_agent.planners.names import planner_list
from tdac_agent.synthesis.options import Engine

app = typer.Typer()


@dataclass(frozen=True, slots=True)
class EvaluateOptions:
    """The further flags of `tdac evaluate`."""

    policies: tuple[str, ...] = option(
        ...,
        "Controller files, run folders, .zip files of stable-baselines3, `reference`, "
        "`builtin`, `follow-guidance`, `random`, or a classical planner: "
        f"{planner_list()}; and files to drive on: a map, a world, task.yaml files or "
        "a set.yaml.",
        argument=True,
        metavar="POLICY...",
    )
    tasks: tuple[str, ...] = option(
        (),
        f"{TASK}; repeatable.  [default: maze]",
        "--task",
        metavar="PATH",
        panel=TASKS,
        scope="task",
    )
    episodes: int | None = option(
        None,
        "Episodes per policy and task; on a task set, worlds.  [default: 100, or all "
        "worlds if there are fewer]",
        "-n",
        "--episodes",
        "--worlds",
        least=1,
    )
    seed: int = option(
        0, "Seed of the episodes, the same for all policies.", least=0, scope="task"
    )
    variation: Variation = option("jitter", VARIATION, scope="task")
    physics: Engine = physics_option()
    wrappers: tuple[str, ...] | None = wrappers_option(
        f"{WRAPPER}  [default: as the .zip file records]", "--wrapper"
    )
    csv: Path | None = option(None, "Write a CSV row per episode.", metavar="FILE")
    out: Path | None = out_option(
        "Folder for evaluation.json and episodes.csv; on tasks, also for timing.csv "
        "and a picture of all trajectories per task; on a task set, for the episodes "
        "of each policy."
    )
    tier: str = tier_option()
    as_json: bool = json_option()
    split: str = option("test", "dev or test.", metavar="NAME", panel=SETS, scope="set")


@app.command(
    epilog="Examples: `tdac evaluate reference builtin go-to-goal --task maze "
    "--task epuck`; `tdac evaluate runs/maze-1 ppo.zip --task maze --out compared`; "
    "`tdac evaluate builtin ppo.zip --set unknown -n 20`"
)
@typed_options("evaluate:run", without=(*ONLY_FOR_SYNTH, "task", "file"))
def evaluate(options: EvaluateOptions, flags: TaskFlags) -> None:
    """Compare policies of any kind on the same tasks and seeds, or on a task set.

    For your own work: a few policies, single tasks, a quick answer. For a ranking on
    several sets, on hidden worlds or with several seeds of a training, use `tdac
    bench`.
    """
