"""An adaptive limit on concurrent requests to a provider.

Each answer raises the limit a little, and a rate limit halves it (additive increase,
multiplicative decrease, as in TCP). All workers of a campaign share a limit through a
folder. Its slots are file locks, so that a process that dies frees its slot.
"""

from __future__ import annotations

import json
import os
import random
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from tdac_agent.campaign.plan import slug
from tdac_agent.models.provider import (
    Provider,
    RateLimited,
    Reply,
    Request,
    missing_for,
    served_at,
)
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.locks import first_free, wait_for
from tdac_envs.core.intake import TEXT_BYTES, parse_json, read_file

FIRST = 8.0
"""Initial number of slots."""
CUT = 0.5
LOOK_SECONDS = 0.2
"""Mean time between two attempts to get a free slot."""


class ConcurrencyLimit:
    """The slots of a provider; each allows one request at a time.

    Args:
        folder: Folder that all workers share; made if missing.
        most: Maximum number of slots.
        sleep: Sleeps for the given seconds.
    """

    def __init__(
        self, folder: Path, most: int, sleep: Callable[[float], None] = time.sleep
    ) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        self._most = float(max(most, 1))
        self._sleep = sleep

    @property
    def slots(self) -> float:
        """Number of slots; a fraction of a slot is not used."""
        return self._read()[0]

    @contextmanager
    def slot(self) -> Generator[float]:
        """Waits for a slot; yields the time it was taken, to pass to `limited`."""
        handle = self._free()
        while handle is None:
            self._sleep(random.uniform(0.5, 1.5) * LOOK_SECONDS)
            handle = self._free()
        try:
            yield time.time()
        finally:
            os.close(handle)

    def answered(self) -> None:
        """Counts an answer; n answers at n slots add about one slot."""
        with wait_for(self._folder / "lock"):
            slots, cut_at = self._read()
            self._write(min(self._most, slots + 1.0 / slots), cut_at)

    def limited(self, asked_at: float) -> None:
        """Halves the slots after a rate limit, unless halved since `asked_at`."""
        with wait_for(self._folder / "lock"):
            slots, cut_at = self._read()
            if asked_at > cut_at:
                self._write(max(1.0, CUT * slots), time.time())

    def _free(self) -> int | None:
        """Locks a slot and returns its descriptor; None if all are taken."""
        numbers = range(int(self.slots))
        free = first_free(self._folder / f"place-{number:03d}" for number in numbers)
        return None if free is None else free[1]

    def _read(self) -> tuple[float, float]:
        """The number of slots, and when it was last halved."""
        with suppress(OSError, ValueError, KeyError, TypeError):
            known = parse_json(read_file(self._folder / "state.json", TEXT_BYTES))
            return min(self._most, float(known["places"])), float(known["cut_at"])
        return min(self._most, FIRST), 0.0

    def _write(self, slots: float, cut_at: float) -> None:
        text = json.dumps({"places": round(slots, 3), "cut_at": cut_at})
        write_atomic(self._folder / "state.json", text)


class LimitedProvider:
    """A provider behind a limit; see `Provider`.

    Args:
        model: The provider.
        limit: The limit that each request passes.
    """

    def __init__(self, model: Provider, limit: ConcurrencyLimit) -> None:
        self.name = model.name
        self.paid = model.paid
        self.served_at = served_at(model)
        self.missing = missing_for(model)
        self._model = model
        self._limit = limit

    def complete(self, request: Request) -> Reply:
        """Answers one request; see `Provider`."""
        with self._limit.slot() as asked_at:
            try:
                reply = self._model.complete(request)
            except RateLimited:
                self._limit.limited(asked_at)
                raise
        self._limit.answered()
        return reply


def limited_provider(model: Provider, folder: Path, most: int) -> Provider:
    """Puts a paid provider behind the limit of its vendor or server."""
    if not model.paid:
        return model
    kind = model.name.partition(":")[0]
    name = slug(f"{kind}-{served_at(model) or ''}")
    return LimitedProvider(model, ConcurrencyLimit(folder / name, most))
