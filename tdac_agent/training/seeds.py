"""Trainings that differ in their seeds, a process each, side by side."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

from tdac_agent.errors import RunError
from tdac_agent.training.checkpoint_marks import check
from tdac_agent.training.curve import Point
from tdac_agent.training.plan import MOST_SEED, TrainingPlan
from tdac_agent.training.train import prepare, train
from tdac_envs.core.arguments import whole_number
from tdac_envs.core.slices import available_cores

SeedWatch = Callable[[int, int, Point | None], None]
"""Called with a seed, its steps so far, and the new evaluation if any."""
_OFTEN = 0.5
"""Seconds between two looks at the processes."""


def seed_folder(folder: Path, seed: int) -> Path:
    """The folder of one seed's training."""
    return folder / f"seed-{seed}"


def train_seeds(
    plan: TrainingPlan,
    seeds: range,
    folder: Path,
    watch: SeedWatch,
    *,
    trust: bool = False,
) -> dict[int, list[Point]]:
    """Trains with each seed, as many at a time as there are cores.

    Each training is that of `train` with its seed alone, to the last digit, and goes on
    from its last checkpoint if it has one.

    Args:
        plan: Plan; its own seed is replaced.
        seeds: The seeds.
        folder: Folder with a folder for each training; made if missing.
        watch: Called with the progress; see `SeedWatch`.
        trust: Whether another installation's checkpoints may be loaded.

    Returns:
        The learning curve of each seed.

    Raises:
        NotTrustedError: As for `train`.
        RunError: As for `train`, or a process was killed.
        TaskError: As for `train`. All other trainings have ended then.
    """
    plans = [_with_seed(plan, seed) for seed in seeds]
    for each in plans:
        own = seed_folder(folder, each.seed)
        prepare(own, each)
        check(own, trust=trust)
    # Spawned: torch and compiled code have threads, which a fork does not copy.
    context = multiprocessing.get_context("spawn")
    told: Any = context.SimpleQueue()
    stop = context.Event()
    at_once = min(available_cores(), len(seeds))
    pool = ProcessPoolExecutor(
        at_once,
        context,
        initializer=_begin,
        initargs=(told, stop),
        max_tasks_per_child=1,
    )
    threads = max(available_cores() // at_once, 1)
    try:
        running = {
            each.seed: pool.submit(
                _train_one, each, seed_folder(folder, each.seed), trust, threads
            )
            for each in plans
        }
        _follow(list(running.values()), told, watch)
        return {seed: each.result() for seed, each in running.items()}
    except BrokenProcessPool as error:
        raise RunError(
            f"a training was killed; the same command continues in {folder}"
        ) from error
    finally:
        stop.set()
        pool.shutdown(wait=True, cancel_futures=True)


def _with_seed(plan: TrainingPlan, seed: int) -> TrainingPlan:
    """The plan with another seed.

    Raises:
        TaskError: The seed is too large.
    """
    whole_number("seed", seed, 0, MOST_SEED)
    return plan.model_copy(update={"seed": seed})


_parent: dict[str, Any] = {}
"""In a process of a training: the queue and the event of the one that started it."""


def _begin(told: Any, stop: Any) -> None:
    """Prepares a process."""
    _parent.update(told=told, stop=stop)


def _train_one(
    plan: TrainingPlan, folder: Path, trust: bool, threads: int
) -> list[Point]:
    told, stop = _parent["told"], _parent["stop"]
    starter = multiprocessing.parent_process()

    def watch(steps: int, point: Point | None, _: Point | None) -> None:
        if stop.is_set() or starter is None or not starter.is_alive():
            raise RunError(f"the training in {folder} was interrupted")
        told.put((plan.seed, steps, point))

    return train(plan, folder, watch, trust=trust, threads=threads)


def _follow(running: list[Future[Any]], told: Any, watch: SeedWatch) -> None:
    """Passes on what the processes tell, until all have ended."""
    left: Any = running
    while left:
        left = wait(left, _OFTEN).not_done
        while not told.empty():
            watch(*told.get())
