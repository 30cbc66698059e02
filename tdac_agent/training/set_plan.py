"""The plan of a training on a task set, and its environments."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.training.hyperparameters import (
    Algo,
    config_file,
    read_hyperparameters,
)
from tdac_agent.training.plan import (
    EPISODES,
    EVALUATIONS,
    MOST_ROBOTS,
    TrainingPlan,
    policy_class,
    wrapped_batch,
)
from tdac_envs.core.arguments import whole_number
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.env import TaskSetEnv, make
from tdac_envs.ladder.set_file import shipped_names
from tdac_envs.ladder.task_sets import TaskSet, load_set
from tdac_envs.ladder.vector import make as make_batch
from tdac_envs.learning.wrapped_vector import WrappedVectorEnv
from tdac_envs.learning.wrapping import default_wrappers, wrap_for_rl

TRAINED, SELECTED = "train", "dev"
"""The split of the training, and that of its evaluations, which select the policy."""
Uses = Literal["rays", "memory", "planner"]
"""Rays alone; also a map of what they showed; also points on a way on this map."""
OWN_MAP: dict[str, tuple[str, ...]] = {
    "memory": ("seen-map",),
    "planner": ("waypoints",),
}
"""The wrappers that come first."""
_AT_ONCE = 50
"""Most robots of an evaluation."""
_OWN = {"level", "split", "salt_file", "privileged"}


def make_set_plan(
    name: str | Path,
    algo: Algo = "ppo",
    *,
    steps: int | None = None,
    seed: int = 0,
    wrappers: tuple[str, ...] | None = None,
    uses: Uses = "rays",
    n_envs: int | None = None,
    episodes: int | None = None,
    config: Path | None = None,
) -> TrainingPlan:
    """Plans a training on a set; what is not given comes from the hyperparameter file.

    Args:
        name: Name of a task set, or path of a `set.yaml`.
        algo: Algorithm.
        steps: Training steps, all robots together.
        seed: Seed of networks, worlds and noise.
        wrappers: Names of wrappers, innermost first.
        uses: What the policy uses besides; the default wrappers follow from it.
        n_envs: Number of robots in parallel.
        episodes: Worlds of each evaluation. By default `EPISODES`, or as many as the
            set has.
        config: Hyperparameter file, in the format of rl-zoo3.

    Raises:
        TaskError: The set, a wrapper or a number is invalid, or the set has no worlds
            to train on.
    """
    tasks = load_set(name)
    for argument, number in (("n_envs", n_envs), ("episodes", episodes)):
        if number is not None:
            whole_number(argument, number, 1, MOST_ROBOTS)
    defaults = read_hyperparameters(config or config_file(algo), TaskSetEnv.title)
    for own in _OWN & defaults.env.keys():
        raise TaskError(f"env_kwargs: {own} is set by the training; leave it out")
    tasks.check_count(TRAINED, 1, "training worlds")
    tasks.check_count(SELECTED, episodes or 1, "episodes")
    env: Any = make(name, split=SELECTED)
    chosen = default_wrappers(env) if defaults.wrappers is None else defaults.wrappers
    chosen = OWN_MAP.get(uses, ()) + tuple(chosen)
    names = chosen if wrappers is None else wrappers
    wrap_for_rl(env, names)  # checks that they support what is observed
    count = tasks.count(SELECTED)
    wanted = steps or defaults.steps
    return TrainingPlan(
        algo=algo,
        tasks=(),
        task_sha256=(),
        set=str(name) if str(name) in shipped_names() else str(Path(name).resolve()),
        set_sha256=tasks.sha256,
        wrappers=names,
        variation="nominal",
        env_kwargs=defaults.env,
        disturbance=Disturbance(0.0, 0.0, 0.0, 0),
        steps=wanted,
        seed=seed,
        n_envs=n_envs or defaults.n_envs,
        policy=policy_class(defaults, names),
        initial_action=defaults.initial_action,
        hyperparameters=defaults.model,
        evaluate_every=max(wanted // EVALUATIONS, 1),
        episodes=episodes or min(EPISODES, count or EPISODES),
    )


def set_of(plan: TrainingPlan) -> TaskSet:
    """Loads the set of a plan.

    Raises:
        TaskError: It has changed since the plan was made, or cannot be used.
    """
    assert plan.set is not None
    tasks = load_set(plan.set)
    if tasks.sha256 != plan.set_sha256:
        raise TaskError(f"the set {plan.set!r} has changed since the training began")
    return tasks


def make_set_batch(plan: TrainingPlan, threads: int | None = None) -> Any:
    """Makes the robots of a training, with its wrappers, for SB3.

    Args:
        plan: The plan.
        threads: Number of threads; by default the number of cores.

    Raises:
        TaskError: The set has changed since the plan was made, or cannot be used.
    """
    from tdac_envs.learning.sb3 import SB3VecEnv

    own = {**plan.env_kwargs, "threads": threads}
    batch = _batch(plan, plan.n_envs, TRAINED, "SameStep", own)
    return SB3VecEnv(batch)


def make_trials(plan: TrainingPlan, threads: int | None = None) -> WrappedVectorEnv:
    """Makes the robots of an evaluation.

    Args:
        plan: The plan.
        threads: Number of threads; by default the number of cores.

    Raises:
        TaskError: As for `make_set_batch`.
    """
    count = min(plan.episodes, _AT_ONCE)
    return _batch(plan, count, SELECTED, "Disabled", {"threads": threads})


def _batch(
    plan: TrainingPlan, count: int, split: str, mode: str, own: dict[str, Any]
) -> WrappedVectorEnv:
    set_of(plan)
    facts = {"level": str(plan.set), "split": split, **own}
    return wrapped_batch(plan, make_batch, count, mode, **facts)
