"""Run blocking work in threads that neither an interrupt nor the end waits for."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Collection
from concurrent.futures import Future, wait
from typing import TypeVar

from tdac_agent.models.provider import ProviderFault

T = TypeVar("T")

CONNECT_SECONDS = 15.0
LOOK_SECONDS = 0.2
STALL_SECONDS = 300.0
"""Longest gap between two pieces of an answer; small machines read prompts slowly."""


def run_with_timeout(
    seconds: float, work: Callable[[], T], let_go: Callable[[], None]
) -> T:
    """Returns the result of `work`, or raises a fault if it takes too long.

    Neither a slow name server nor a server that sends a byte now and then can delay an
    interrupt or exceed the time.

    Args:
        seconds: Time limit.
        work: Function to run; its exceptions are passed on.
        let_go: Called when its result is no longer awaited.

    Raises:
        ProviderFault: It took longer.
    """
    future = in_thread(work)
    try:
        wait_for_all([future], seconds)
        return future.result(0.0)
    except TimeoutError:
        let_go()
        raise ProviderFault(f"no complete answer within {seconds:.3g} s") from None
    except BaseException:
        let_go()
        raise


def in_thread(work: Callable[[], T]) -> Future[T]:
    """Starts work in a thread that ends with the process; its result comes later."""
    future: Future[T] = Future()

    def run() -> None:
        try:
            future.set_result(work())
        except BaseException as error:
            future.set_exception(error)

    threading.Thread(target=run, daemon=True, name="tdac-call").start()
    return future


def wait_for_all(futures: Collection[Future[T]], seconds: float = math.inf) -> None:
    """Waits until all results are there, or for some time; an interrupt ends it.

    It waits in slices: a signal that comes just before a wait does not end that wait.
    """
    end = time.monotonic() + seconds
    while time.monotonic() < end and wait(futures, LOOK_SECONDS).not_done:
        pass
