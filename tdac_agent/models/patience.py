"""Waiting for what may never come, and letting go of it at once."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

from tdac_agent.models.provider import ProviderFault

T = TypeVar("T")

CONNECT_SECONDS = 15.0
STALL_SECONDS = 300.0
"""Between two pieces of an answer; models on small machines read a prompt for long."""


def within(seconds: float, work: Callable[[], T], let_go: Callable[[], None]) -> T:
    """What some work returns, or a fault when it takes too long.

    It is done in a thread of its own, so that neither a name server nor a server that
    sends a byte now and then can hold up an interrupt or outlast the time. A thread
    that is given up ends with the process.

    Args:
        seconds: That it may take.
        work: What to do.
        let_go: Called where its result is no longer waited for.

    Raises:
        ProviderFault: It took longer; or what the work raises.
    """
    future: Future[T] = Future()

    def run() -> None:
        try:
            future.set_result(work())
        except BaseException as error:
            future.set_exception(error)

    threading.Thread(target=run, daemon=True, name="tdac-call").start()
    try:
        return future.result(seconds)
    except TimeoutError:
        let_go()
        raise ProviderFault(f"no whole answer within {seconds:.3g} s") from None
    except BaseException:
        let_go()
        raise
