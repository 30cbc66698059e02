"""Sandboxed children that are ready before they are needed."""

from __future__ import annotations

import threading

from tdac_agent.sandbox import (
    TIERS,
    Child,
    Limits,
    NoRoomError,
    SandboxError,
    Tier,
    Zygote,
    find_tier,
    fork_child,
    start_zygote,
)


class Nursery:
    """Keeps a zygote ready that forks children, each for one use.

    Args:
        ahead: Whether to start one for the best tier at once, and the next one when
            that can have no further child.
    """

    def __init__(self, *, ahead: bool = True) -> None:
        self._ahead = ahead
        self._lock = threading.Lock()
        self._best: Tier | None = None
        self._zygotes: list[Zygote] = []
        # Without room, but perhaps with children, which another process may have.
        self._full: list[Zygote] = []
        if ahead:
            self._start_likely()

    def take(self, tier: str, limits: Limits) -> Child:
        """A child that has no controller yet; several threads may ask at once.

        Raises:
            SandboxError: The tier does not work here.
        """
        with self._lock:
            if tier != "auto":
                return self._child(find_tier(tier), limits)
            if self._best is not None:
                return self._child(self._best, limits)
            return self._first_child(limits)

    def close(self) -> None:
        """Has no further children; ends the zygotes that have none."""
        with self._lock:
            for zygote in self._zygotes + self._full:
                zygote.close()
            self._zygotes, self._full = [], []

    def _first_child(self, limits: Limits) -> Child:
        """One of the best tier that turns out to work."""
        reasons = []
        for tier in TIERS:
            try:
                child = self._child(tier, limits)
            except SandboxError as error:
                reasons.append(str(error))
                continue
            self._best = tier
            return child
        raise SandboxError("no sandbox tier works here: " + "; ".join(reasons))

    def _child(self, tier: Tier, limits: Limits) -> Child:
        zygote = self._zygote(tier, limits)
        try:
            child = fork_child(zygote, tier, limits)
        except NoRoomError:
            return self._child(tier, limits)
        except SandboxError:
            self._drop(zygote)
            raise
        if self._ahead and not zygote.slots:
            self._zygotes.append(start_zygote(tier, limits))
        return child

    def _zygote(self, tier: Tier, limits: Limits) -> Zygote:
        """One with room for a further child."""
        full = [zygote for zygote in self._zygotes if not zygote.slots]
        self._full = [zygote for zygote in self._full + full if not zygote.ended]
        self._zygotes = [zygote for zygote in self._zygotes if zygote.slots]
        for zygote in self._zygotes:
            if _suits(zygote, tier, limits):
                return zygote
        self._zygotes.append(start_zygote(tier, limits))
        return self._zygotes[-1]

    def _drop(self, zygote: Zygote) -> None:
        self._zygotes.remove(zygote)
        zygote.close()

    def _start_likely(self) -> None:
        """Starts a zygote of the first tier that lets one start."""
        for tier in TIERS:
            try:
                self._zygotes.append(start_zygote(tier, Limits()))
            except SandboxError:
                continue
            return


def _suits(zygote: Zygote, tier: Tier, limits: Limits) -> bool:
    same = zygote.scratch_bytes == limits.scratch_bytes
    return zygote.tier == tier.name and same
