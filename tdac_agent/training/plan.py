"""The plan of a training: everything needed to resume it from its folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import gymnasium as gym
from gymnasium.envs.registration import load_env_creator
from pydantic import Field

from tdac_agent.errors import RunError
from tdac_agent.runs.ownership import load_task
from tdac_agent.storage.files import write_atomic
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.task_file import bundled_task
from tdac_agent.training.curve import PLAN_FILE
from tdac_agent.training.hyperparameters import (
    Algo,
    Hyperparameters,
    config_file,
    read_hyperparameters,
)
from tdac_envs.core.arguments import whole_number
from tdac_envs.core.errors import TaskError, one_line_reason
from tdac_envs.core.intake import TEXT_BYTES, parse_json, read_file
from tdac_envs.core.strict_model import StrictModel
from tdac_envs.learning.wrapped_vector import WrappedVectorEnv
from tdac_envs.learning.wrappers import check_wrappers
from tdac_envs.learning.wrapping import FOR_RL, wrap_for_rl

Variation = Literal["nominal", "jitter", "mixed", "random"]
EVALUATIONS, EPISODES = 12, 100
MOST_ROBOTS = 100_000
"""Largest batch; an evaluation runs all of its episodes in one batch."""
MOST_SEED = 2**31
"""Largest seed of a training."""


class TrainingPlan(StrictModel):
    """`training.json` of a training's folder."""

    schema_version: Literal[1] = 1
    algo: Algo
    tasks: tuple[str, ...] = Field(
        description="Robot i has task i modulo their number."
    )
    task_sha256: tuple[str, ...]
    set: str | None = Field(
        None, description="Name or file of a task set, instead of tasks."
    )
    set_sha256: str | None = None
    wrappers: tuple[str, ...] = Field(description="Innermost first; see `wrap`.")
    variation: Variation = Field("jitter", description="Starts in evaluations.")
    env_kwargs: dict[str, Any] = Field(
        default_factory=dict,
        description="Arguments of the training environments that differ from those of "
        "the evaluations.",
    )
    disturbance: Disturbance
    steps: int = Field(description="Training steps, all robots together.")
    seed: int = 0
    n_envs: int
    policy: str = "MlpPolicy"
    initial_action: float = Field(
        0.0, ge=-1, le=1, description="Mean action before the training, both wheels."
    )
    from_policy: str | None = Field(
        None, description="File of the policy whose weights it begins with."
    )
    from_sha256: str | None = None
    hyperparameters: dict[str, Any]
    evaluate_every: int = Field(description="Steps between evaluations.")
    episodes: int = Field(EPISODES, description="Episodes of each evaluation.")

    @property
    def worlds(self) -> str:
        """What it trains on, as `training.json` names it."""
        return ", ".join(self.tasks) if self.set is None else self.set


def make_plan(
    tasks: tuple[str, ...],
    algo: Algo = "ppo",
    *,
    steps: int | None = None,
    seed: int = 0,
    variation: Variation | None = None,
    disturbance: Disturbance | None = None,
    wrappers: tuple[str, ...] | None = None,
    n_envs: int | None = None,
    episodes: int = EPISODES,
    config: Path | None = None,
) -> TrainingPlan:
    """Plans a training; what is not given comes from the hyperparameter file.

    Args:
        tasks: Names or files of tasks of one environment.
        algo: Algorithm.
        steps: Training steps, all robots together.
        seed: Seed of networks, starts and noise.
        variation: Variation of the starts in training and evaluation. By default
            `jitter` in evaluation, and that of the hyperparameter file in training.
        disturbance: Noise and delay; none by default.
        wrappers: Names of wrappers, innermost first.
        n_envs: Number of robots in parallel.
        episodes: Episodes of each evaluation.
        config: Hyperparameter file, in the format of rl-zoo3.

    Raises:
        TaskError: A task, a wrapper or a number is invalid, or the tasks are of
            different environments.
    """
    whole_number("seed", seed, 0, MOST_SEED)
    for name, robots in (("n_envs", n_envs or 1), ("episodes", episodes)):
        whole_number(name, robots, 1, MOST_ROBOTS)
    loaded = [load_task(name) for name in tasks]
    if len({task.spec.env for task in loaded}) != 1:
        raise TaskError("expected tasks of one environment: all maps, or all worlds")
    disturbance = disturbance or Disturbance(0.0, 0.0, 0.0, 0)
    for task in loaded:
        task.disturbed_options(disturbance)
    defaults = read_hyperparameters(config or config_file(algo), loaded[0].spec.env)
    chosen = FOR_RL if defaults.wrappers is None else defaults.wrappers
    names = chosen if wrappers is None else wrappers
    check_wrappers(names)
    if len(loaded) > 1 and "goal-relative" not in names:
        raise TaskError(
            "several tasks need --wrapper goal-relative: positions on one map mean "
            "nothing on another"
        )
    count = n_envs or defaults.n_envs
    wanted = steps or defaults.steps
    return TrainingPlan(
        algo=algo,
        tasks=tuple(map(_lasting_name, tasks)),
        task_sha256=tuple(task.sha256() for task in loaded),
        wrappers=names,
        variation=variation or "jitter",
        env_kwargs=_env_kwargs(defaults, variation, loaded[0]),
        disturbance=disturbance,
        steps=wanted,
        seed=seed,
        n_envs=max(count, len(tasks)),
        policy=policy_class(defaults, names),
        initial_action=defaults.initial_action,
        hyperparameters=defaults.model,
        evaluate_every=max(wanted // EVALUATIONS, 1),
        episodes=max(episodes, len(tasks)),
    )


def write_plan(folder: Path, plan: TrainingPlan) -> None:
    """Writes `training.json`."""
    write_atomic(folder / PLAN_FILE, plan.model_dump_json(indent=2) + "\n")


def read_plan(folder: Path) -> TrainingPlan:
    """Reads the plan of a training.

    Raises:
        RunError: The folder has no readable plan.
    """
    file = folder / PLAN_FILE
    try:
        return TrainingPlan.model_validate(parse_json(read_file(file, TEXT_BYTES)))
    except OSError as error:
        reason = error.strerror
        raise RunError(f"no training in {str(folder)!r}: {file}: {reason}") from error
    except ValueError as error:
        raise RunError(f"{file}: {one_line_reason(error)}") from error


def tasks_of(plan: TrainingPlan) -> list[Task]:
    """Loads the tasks of a plan.

    Raises:
        TaskError: A task has changed since the plan was made, or cannot be used.
    """
    tasks = [load_task(name) for name in plan.tasks]
    for name, task, sha256 in zip(plan.tasks, tasks, plan.task_sha256, strict=True):
        if task.sha256() != sha256:
            raise TaskError(f"the task {name!r} has changed since the training began")
    return tasks


def make_batch(
    plan: TrainingPlan,
    count: int,
    *,
    training: bool = False,
    threads: int | None = None,
) -> Any:
    """Makes a batch of robots on a plan's tasks, with its wrappers, for SB3.

    Args:
        plan: Plan of the training.
        count: Number of robots.
        training: Whether the batch is for training instead of evaluation.
        threads: Number of threads; by default the number of cores.

    Raises:
        TaskError: A task has changed since the plan was made, or cannot be used.
    """
    from tdac_envs.learning.sb3 import SB3VecEnv

    tasks = tasks_of(plan)
    own = {"variation": plan.variation, **(plan.env_kwargs if training else {})}
    each = [
        task.env_kwargs() | task.disturbed_options(plan.disturbance) | own
        for task in tasks
    ]
    make = load_env_creator(str(gym.spec(tasks[0].spec.env).vector_entry_point))
    options = {"threads": threads, "each": each}
    return SB3VecEnv(wrapped_batch(plan, make, count, "SameStep", **options))


def wrapped_batch(
    plan: TrainingPlan, make: Any, count: int, mode: str, **kwargs: Any
) -> WrappedVectorEnv:
    """Makes a batch of robots with a plan's wrappers.

    Args:
        plan: Plan of the training.
        make: Entry point of the batch.
        count: Number of robots.
        mode: When robots are reset.
        kwargs: Further arguments of the entry point.

    Raises:
        TaskError: An argument is unknown.
    """
    try:
        batch = make(count, autoreset_mode=mode, **kwargs)
    except TypeError as error:
        reason = str(error).partition("() ")[2]
        raise TaskError(f"env_kwargs of the hyperparameters: {reason}") from error
    wrapped: WrappedVectorEnv = wrap_for_rl(batch, plan.wrappers)
    return wrapped


def _env_kwargs(
    defaults: Hyperparameters, variation: Variation | None, task: Task
) -> dict[str, Any]:
    """Arguments of the training environments.

    Raises:
        TaskError: The task sets one of them.
    """
    for name in defaults.env:
        if name in task.env_kwargs():
            raise TaskError(f"env_kwargs: {name} is set by the task; leave it out")
    return defaults.env | ({} if variation is None else {"variation": variation})


def policy_class(defaults: Hyperparameters, wrappers: tuple[str, ...]) -> str:
    """The policy class, for observations of one array or of several."""
    flat = defaults.policy.replace("MultiInput", "Mlp")
    return flat if "flatten" in wrappers else flat.replace("Mlp", "MultiInput")


def _lasting_name(name: str) -> str:
    """The name of a task, valid in any working directory."""
    return name if bundled_task(name) is not None else str(Path(name).resolve())
