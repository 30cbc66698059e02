"""The child pool: sandboxed children that are ready before they are needed."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import threading

from tdac_agent.sandbox import (
    CONFINING,
    Child,
    Limits,
    NoRoomError,
    SandboxError,
    Tier,
    Zygote,
    find_tier,
    fork_child,
    no_confining_tier_error,
    start_zygote,
)
from tdac_agent.sandbox.counters import shared_counters

# Number of children that the verification of a good controller takes.
READY = 10


class ChildPool:
    """The child pool: keeps a zygote ready that forks children, each for one use.

    Forks of the process that made the pool can use it, too, and share its children.

    Args:
        ahead: Whether to start a zygote of the best tier at once, and the next one as
            soon as that one is full.
    """

    def __init__(self, *, ahead: bool = True) -> None:
        self._ahead = ahead
        self._lock = threading.Lock()
        self._best: Tier | None = None
        self._zygotes: list[Zygote] = []
        # Without free slots, but maybe with children in use by other processes.
        self._full: list[Zygote] = []
        self._ready: list[Child] = []
        # Number of ready children that were taken.
        self._taken = shared_counters(1)
        self._taking = multiprocessing.get_context("fork").Lock()
        self._owner = os.getpid()
        if ahead:
            self._start_likely()

    def take(self, tier: str, limits: Limits) -> Child:
        """Returns a child without a controller; safe to call from several threads.

        The child may run on the cores that the caller may run on.

        Raises:
            SandboxError: The tier does not work on this machine.
        """
        child = self._ready_child(tier, limits) or self._new_child(tier, limits)
        # If the child has ended, its first call reports that.
        with contextlib.suppress(OSError):
            os.sched_setaffinity(child.controller_pid, os.sched_getaffinity(0))
        return child

    def _new_child(self, tier: str, limits: Limits) -> Child:
        with self._lock:
            if tier != "auto":
                return self._child(find_tier(tier), limits)
            if self._best is not None:
                return self._child(self._best, limits)
            return self._first_child(limits)

    def prepare(self) -> bool:
        """Starts one more ready child with the default limits; False if it starts none.

        Call it before forking: only the calling process ends unused children.
        """
        self._owner = os.getpid()
        if len(self._ready) >= READY:
            return False
        try:
            self._ready.append(self._first_child(Limits()))
        except SandboxError:
            return False
        return True

    def _ready_child(self, tier: str, limits: Limits) -> Child | None:
        if not self._ready or limits != Limits():
            return None
        if tier not in ("auto", self._ready[0].tier):
            return None
        with self._taking:
            number = self._taken[0]
            self._taken[0] += 1
        return self._ready[number] if number < len(self._ready) else None

    def close(self) -> None:
        """Ends unused ready children; the zygotes end with their last child."""
        if os.getpid() == self._owner:
            for child in self._ready[self._taken[0] :]:
                child.close()
        with self._lock:
            for zygote in self._zygotes + self._full:
                zygote.close()
            self._zygotes, self._full = [], []

    def __enter__(self) -> ChildPool:
        return self

    def __exit__(self, *error: object) -> None:
        self.kill()

    def kill(self) -> None:
        """Kills all zygotes; the processes that used the pool must have ended."""
        for zygote in self._zygotes + self._full:
            zygote.kill()

    def _first_child(self, limits: Limits) -> Child:
        """A child of the best tier that works."""
        reasons = []
        for tier in CONFINING:
            try:
                child = self._child(tier, limits)
            except SandboxError as error:
                reasons.append(str(error))
                continue
            self._best = tier
            return child
        raise no_confining_tier_error(reasons)

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
        full = [zygote for zygote in self._zygotes if not zygote.slots]
        self._full = [zygote for zygote in self._full + full if not zygote.ended]
        self._zygotes = [zygote for zygote in self._zygotes if zygote.slots]
        for zygote in self._zygotes:
            if _suits(zygote, tier, limits):
                return zygote
        started = start_zygote(tier, limits)
        self._zygotes.append(started)
        return started

    def _drop(self, zygote: Zygote) -> None:
        self._zygotes.remove(zygote)
        zygote.close()

    def _start_likely(self) -> None:
        """Starts a zygote of the best tier that can start one."""
        for tier in CONFINING:
            try:
                self._zygotes.append(start_zygote(tier, Limits()))
            except SandboxError:
                continue
            return


def _suits(zygote: Zygote, tier: Tier, limits: Limits) -> bool:
    same = zygote.scratch_bytes == limits.scratch_bytes
    return zygote.tier == tier.name and same
