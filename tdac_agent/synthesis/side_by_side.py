"""Runs functions at the same time, in threads that an interrupt does not wait for."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TypeVar

from tdac_agent.models.timeout import LOOK_SECONDS

T = TypeVar("T")
_Outcome = tuple[int, T | None, BaseException | None]


def side_by_side(functions: Sequence[Callable[[], T]]) -> list[T]:
    """Calls all functions at the same time; returns their results in order.

    Returns when all have ended. An interrupt of the calling thread leaves at once; the
    threads then end with the process.

    Raises:
        BaseException: The first function in order that failed, with its error.
    """
    outcomes: queue.SimpleQueue[_Outcome[T]] = queue.SimpleQueue()

    def call(number: int, function: Callable[[], T]) -> None:
        try:
            outcomes.put((number, function(), None))
        except BaseException as error:  # raised again below
            outcomes.put((number, None, error))

    for number, function in enumerate(functions):
        threading.Thread(target=call, args=(number, function), daemon=True).start()
    found = sorted((_next(outcomes) for _ in functions), key=lambda each: each[0])
    results: list[T] = []
    for _, result, error in found:
        if error is not None:
            raise error
        results.append(result)  # type: ignore[arg-type]
    return results


def _next(outcomes: queue.SimpleQueue[_Outcome[T]]) -> _Outcome[T]:
    """The next outcome; a signal that comes just before a wait does not end it."""
    while True:
        with suppress(queue.Empty):
            return outcomes.get(timeout=LOOK_SECONDS)
