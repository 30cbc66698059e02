"""Trainings that differ in their seeds, a process each, side by side."""

from __future__ import annotations

import multiprocessing
import queue
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from pathlib import Path
from typing import Any

from tdac_agent.errors import RunError
from tdac_agent.training.curve import Point
from tdac_agent.training.plan import TrainingPlan
from tdac_agent.training.train import train
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
        RunError: As for `train`, or a process was killed.
        TaskError: As for `train`.
    """
    # Spawned: torch and compiled code have threads, which a fork does not copy.
    context = multiprocessing.get_context("spawn")
    with context.Manager() as manager:
        told: Any = manager.Queue()
        at_once = min(available_cores(), len(seeds))
        pool = ProcessPoolExecutor(at_once, context, max_tasks_per_child=1)
        try:
            running = {
                seed: pool.submit(
                    _train_one,
                    plan.model_copy(update={"seed": seed}),
                    seed_folder(folder, seed),
                    trust,
                    max(available_cores() // at_once, 1),
                    told,
                )
                for seed in seeds
            }
            _follow(list(running.values()), told, watch)
            return {seed: each.result() for seed, each in running.items()}
        except BrokenProcessPool as error:
            raise RunError(
                f"a training was killed; the same command continues in {folder}"
            ) from error
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _train_one(
    plan: TrainingPlan, folder: Path, trust: bool, threads: int, told: Any
) -> list[Point]:
    def watch(steps: int, point: Point | None, _: Point | None) -> None:
        told.put((plan.seed, steps, point))

    return train(plan, folder, watch, trust=trust, threads=threads)


def _follow(running: list[Future[Any]], told: Any, watch: SeedWatch) -> None:
    """Passes on what the processes tell, until all have ended or one has failed."""
    look = partial(told.get, timeout=_OFTEN)
    while not all(each.done() for each in running):
        failed = [e for e in running if e.done() and e.exception() is not None]
        if failed:
            failed[0].result()
        try:
            watch(*look())
        except queue.Empty:
            continue
    while True:
        try:
            watch(*told.get_nowait())
        except queue.Empty:
            return
