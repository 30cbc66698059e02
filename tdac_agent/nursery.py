"""Sandboxed children that are ready before they are needed."""

from __future__ import annotations

import threading
from concurrent.futures import Future, ThreadPoolExecutor

from tdac_agent.sandbox import (
    Child,
    Limits,
    Tier,
    Zygote,
    best_tier,
    find_tier,
    fork_child,
    start_zygote,
)

Kind = tuple[str, int]


class Nursery:
    """Keeps a zygote ready that forks children, each for one use.

    Args:
        ahead: Whether to start one for the best tier at once, and the next one when
            that can have no further child.
    """

    def __init__(self, *, ahead: bool = True) -> None:
        self._ahead = ahead
        self._lock = threading.Lock()
        self._pool = ThreadPoolExecutor(max_workers=1)
        self._zygotes: list[Zygote] = []
        self._next: Future[Zygote] | None = None
        if ahead:
            self._next = self._pool.submit(_zygote_of_best_tier)

    def take(self, tier: str, limits: Limits) -> Child:
        """A child that has no controller yet.

        Raises:
            SandboxError: The tier does not work here.
        """
        wanted = find_tier(tier)
        with self._lock:
            zygote = self._zygote(wanted, limits)
            child = fork_child(zygote, wanted, limits)
            if not zygote.slots:
                self._zygotes.remove(zygote)
                if self._ahead and self._next is None:
                    self._next = self._pool.submit(start_zygote, wanted, limits)
        return child

    def close(self) -> None:
        """Has no further children; ends the zygotes that have none."""
        self._pool.shutdown()
        if self._next is not None and self._next.exception() is None:
            self._next.result().close()
        for zygote in self._zygotes:
            zygote.close()

    def _zygote(self, tier: Tier, limits: Limits) -> Zygote:
        """One with room for a further child."""
        if not any(_suits(zygote, tier, limits) for zygote in self._zygotes):
            ready, self._next = self._next, None
            if ready is not None:
                self._zygotes.append(ready.result())
        for zygote in self._zygotes:
            if _suits(zygote, tier, limits):
                return zygote
        self._zygotes.append(start_zygote(tier, limits))
        return self._zygotes[-1]


def _suits(zygote: Zygote, tier: Tier, limits: Limits) -> bool:
    return zygote.tier == tier.name and zygote.scratch_bytes == limits.scratch_bytes


def _zygote_of_best_tier() -> Zygote:
    return start_zygote(best_tier(), Limits())
