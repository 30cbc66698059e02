"""Runs many episodes in the judge's worker pool, and yields them in order."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
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


T = TypeVar("T")
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
    patience = late + len(numbers) + 1 if patience is None else patience
    with drivers(work, end, min(SIZE, len(numbers))) as drive:
        yield from drive(numbers, [0] * late, patience)


@contextmanager
def drivers(
    work: Callable[[T, bool], R], end: Callable[[], None], size: int = SIZE
) -> Generator[Callable[[Iterable[T], list[T], int], Iterator[R]]]:
    """A worker pool for any number of batches; see `in_order`.

    Returns:
        Drives a batch. Its arguments are what distinguishes the episodes, those that
        timed out so far, and the patience.
    """
    turns = Turns(size)
    with (
        closing(WorkerPool(work, end, size)) as worker_pool,
        ThreadPoolExecutor(max_workers=size) as pool,
    ):

        def drive(items: Iterable[T], late: list[T], patience: int) -> Iterator[R]:
            return pool.map(
                partial(_run_with_retry, worker_pool, turns, late, patience), items
            )

        try:
            yield drive
        finally:
            pool.shutdown(cancel_futures=True)


def _run_with_retry(
    worker_pool: WorkerPool[[T, bool], R],
    turns: Turns,
    late: list[T],
    patience: int,
    item: T,
) -> R:
    skip = len(late) >= patience
    with turns.beside():
        kept = worker_pool.do(item, skip)
    if kept.late and kept.is_retryable and len(late) < patience:
        with turns.alone():
            kept = worker_pool.do(item, False)
    if kept.late:
        late.append(item)
    return kept
