"""One retry loop for all providers; nothing below it asks twice."""

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
    """When a question is put again after a fault, and when it is given up.

    Attributes:
        retries: After faults that may pass. Rate limits are waited for instead.
        seconds: In which the question must be answered, waiting included.
        first_wait: Upper end of the first wait, s; it doubles with each fault, and
            the wait is drawn between half of that and all of it.
        longest_wait: No wait is longer, s, whatever the provider asks for.
    """

    retries: int = 3
    seconds: float = 1800.0
    first_wait: float = 2.0
    longest_wait: float = 60.0

    def __post_init__(self) -> None:
        numbers = (self.retries, self.seconds, self.first_wait, self.longest_wait)
        if min(numbers) < 0:
            raise ValueError(f"a retry policy has no negative numbers: {self}")


class Missed(NamedTuple):
    """A call that failed: how often so far, why, and the wait before the next, s.

    The wait is None where the question is given up.
    """

    attempt: int
    fault: ProviderFault
    wait: float | None


def answer(
    complete: Callable[[Request], Reply],
    request: Request,
    policy: RetryPolicy,
    on_fault: Callable[[Missed], None],
    sleep: Callable[[float], None] = time.sleep,
) -> Reply:
    """The answer of a model that may have to be asked again.

    Args:
        complete: Asks it once.
        request: What.
        policy: How patiently.
        on_fault: Called after each call that failed, before the wait.
        sleep: Waits; an interrupt ends it at once.

    Raises:
        ProviderFault: The last one, when the question is given up.
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
            on_fault(Missed(attempt, fault, wait))
            if wait is None:
                raise
            sleep(wait)


def _wait(
    fault: ProviderFault, attempt: int, policy: RetryPolicy, left: float
) -> float | None:
    """Seconds before the next attempt, None where there is to be none."""
    if isinstance(fault, PermanentFault):
        return None
    limited = isinstance(fault, RateLimited)
    if not limited and attempt > policy.retries:
        return None
    # Capped before the power: of a provider that is limited for hours it is large.
    longest = min(policy.longest_wait, policy.first_wait * 2 ** min(attempt - 1, 20))
    wait = random.uniform(longest / 2, longest)
    if fault.retry_after is not None:
        wait = min(max(wait, fault.retry_after), policy.longest_wait)
    return wait if wait < left else None
