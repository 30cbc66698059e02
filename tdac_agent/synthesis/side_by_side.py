"""Runs functions at the same time, in threads that an interrupt does not wait for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from tdac_agent.models.timeout import in_thread, wait_for_all

T = TypeVar("T")


def side_by_side(functions: Sequence[Callable[[], T]]) -> list[T]:
    """Calls all functions at the same time; returns their results in order.

    Returns when all have ended. An interrupt of the calling thread leaves at once; the
    threads then end with the process.

    Raises:
        BaseException: The first function in order that failed, with its error.
    """
    futures = [in_thread(function) for function in functions]
    wait_for_all(futures)
    return [future.result() for future in futures]
