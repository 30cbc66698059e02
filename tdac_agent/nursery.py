"""Sandboxed children that are started before they are needed."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor

from tdac_agent.sandbox import Child, Limits, start

SPARES = 2


class Nursery:
    """Keeps a few children started, each for one use.

    Only the best tier with the usual limits is started ahead; others are started when
    they are asked for.

    Args:
        spares: How many to keep ready.
    """

    def __init__(self, spares: int = SPARES) -> None:
        self._pool = ThreadPoolExecutor(max_workers=1)
        self._ready: list[Future[Child]] = []
        for _ in range(spares):
            self._grow()

    def take(self, tier: str, limits: Limits) -> Child:
        """A child that has no controller yet.

        Raises:
            SandboxError: The tier does not work here.
        """
        if tier != "auto" or limits != Limits():
            return start(tier=tier, limits=limits)
        try:
            future = self._ready.pop(0)
        except IndexError:  # None is kept, or other threads took them all.
            return start()
        self._grow()
        return future.result()

    def close(self) -> None:
        """Ends the children that were not used."""
        for future in self._ready:
            if not future.cancel() and future.exception() is None:
                future.result().close()
        self._ready = []
        self._pool.shutdown()

    def _grow(self) -> None:
        self._ready.append(self._pool.submit(start))
