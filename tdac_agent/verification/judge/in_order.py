"""Runs many episodes in the judge's worker pool, and yields them in order."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from functools import partial
from typing import Protocol, TypeVar

from tdac_agent.verification.judge.turns import Turns
from tdac_agent.verification.judge.worker_pool import SIZE, WorkerPool


class Timed(Protocol):
    """What is kept of an episode."""

    @property
    def late(self) -> bool:
        """Whether the controller timed out."""

    @property
    def is_retryable(self) -> bool:
        """Whether the time-out may be due to a busy machine."""


R = TypeVar("R", bound=Timed)


def in_order(
    work: Callable[[int, bool], R],
    end: Callable[[], None],
    numbers: Sequence[int],
    late: int = 0,
    patience: int | None = None,
) -> Generator[R]:
    """Yields episodes in order, several running at a time; closing waits for them.

    After a time-out that may be due to a busy machine, an episode is run once more,
    alone.

    Args:
        work: Runs the episode of a number in a process of the pool; if its second
            argument is true, skips it.
        end: Called in each process of the pool before it ends.
        numbers: Numbers of the episodes.
        late: Number of time-outs before these episodes.
        patience: Number of time-outs after which the rest is skipped; None for never.
    """
    size = min(SIZE, len(numbers))
    turns, ends = Turns(size), [0] * late
    patience = late + len(numbers) + 1 if patience is None else patience
    with (
        closing(WorkerPool(work, end, size)) as worker_pool,
        ThreadPoolExecutor(max_workers=size) as pool,
    ):
        try:
            run = partial(_run_with_retry, worker_pool, turns, ends, patience)
            yield from pool.map(run, numbers)
        finally:
            pool.shutdown(cancel_futures=True)


def _run_with_retry(
    worker_pool: WorkerPool[[int, bool], R],
    turns: Turns,
    late: list[int],
    patience: int,
    number: int,
) -> R:
    skip = len(late) >= patience
    with turns.beside():
        kept = worker_pool.do(number, skip)
    if kept.late and kept.is_retryable and len(late) < patience:
        with turns.alone():
            kept = worker_pool.do(number, False)
    if kept.late:
        late.append(number)
    return kept
