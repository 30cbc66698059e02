"""Run blocking work with a time limit."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
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

    It runs in a separate thread, so that neither a slow name server nor a server that
    sends a byte now and then can delay an interrupt or exceed the time. An abandoned
    thread ends with the process.

    Args:
        seconds: Time limit.
        work: Function to run; its exceptions are passed on.
        let_go: Called when its result is no longer awaited.

    Raises:
        ProviderFault: It took longer.
    """
    future: Future[T] = Future()

    def run() -> None:
        try:
            future.set_result(work())
        except BaseException as error:
            future.set_exception(error)

    threading.Thread(target=run, daemon=True, name="tdac-call").start()
    end = time.monotonic() + seconds
    try:
        # In slices: a signal that comes just before a wait does not end it.
        while time.monotonic() < end and not wait([future], LOOK_SECONDS).done:
            pass
        return future.result(0.0)
    except TimeoutError:
        let_go()
        raise ProviderFault(f"no complete answer within {seconds:.3g} s") from None
    except BaseException:
        let_go()
        raise
