"""The one retry loop of all providers; the vendors' own retries are off."""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

from tdac_agent.models.provider import (
    PermanentFault,
    ProviderFault,
    RateLimited,
    Reply,
    Request,
)


@dataclass(frozen=True, slots=True)
class RetryPolicy:
    """Rules for asking again after a fault, and for giving up.

    Attributes:
        retries: Retries after transient faults; rate limits are not counted.
        seconds: Time limit of the question, waits included.
        first_wait: Upper bound of the first wait, s; it doubles with each fault. A
            wait is drawn between half the bound and the bound.
        longest_wait: Longest wait, s, whatever the provider asks for.
    """

    retries: int = 3
    seconds: float = 1800.0
    first_wait: float = 2.0
    longest_wait: float = 60.0

    def __post_init__(self) -> None:
        numbers = (self.retries, self.seconds, self.first_wait, self.longest_wait)
        if min(numbers) < 0:
            raise ValueError(f"a retry policy must have no negative numbers: {self}")


class FailedCall(NamedTuple):
    """A failed call: attempt number from 1, fault, and wait before the next call, s.

    The wait is None if the question is given up.
    """

    attempt: int
    fault: ProviderFault
    wait: float | None


def answer(
    complete: Callable[[Request], Reply],
    request: Request,
    policy: RetryPolicy,
    on_fault: Callable[[FailedCall], None],
    sleep: Callable[[float], None] = time.sleep,
) -> Reply:
    """Returns a model's answer, asking again after faults.

    Args:
        complete: Asks the model once.
        request: The question.
        policy: Number of retries and length of the waits.
        on_fault: Called after each failed call, before the wait.
        sleep: Waits for the given seconds; an interrupt ends it at once.

    Raises:
        ProviderFault: The last fault, when the question is given up.
    """
    end = time.monotonic() + policy.seconds
    attempt = 0
    while True:
        attempt += 1
        left = max(0.0, end - time.monotonic())
        try:
            return complete(replace(request, seconds=min(request.seconds, left)))
        except ProviderFault as fault:
            wait = _wait(fault, attempt, policy, end - time.monotonic())
            on_fault(FailedCall(attempt, fault, wait))
            if wait is None:
                raise
            sleep(wait)


def _wait(
    fault: ProviderFault, attempt: int, policy: RetryPolicy, left: float
) -> float | None:
    """Returns the seconds before the next attempt; None to give up."""
    if isinstance(fault, PermanentFault):
        return None
    limited = isinstance(fault, RateLimited)
    if not limited and attempt > policy.retries:
        return None
    # The exponent is capped: a rate limit that lasts for hours makes it large.
    longest = min(policy.longest_wait, policy.first_wait * 2 ** min(attempt - 1, 20))
    wait = random.uniform(longest / 2, longest)
    if fault.retry_after is not None:
        wait = min(max(wait, fault.retry_after), policy.longest_wait)
    return wait if wait < left else None
