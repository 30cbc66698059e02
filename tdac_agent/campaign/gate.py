"""How many questions a provider is asked at a time: as many as it bears.

Each answer lets a little more through, a rate limit half as much (additive increase,
multiplicative decrease, as TCP does it). All workers of a campaign share a gate through
a folder; who dies has let go of its place, since the places are locks of the system.
"""

from __future__ import annotations

import fcntl
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
from tdac_agent.storage.locks import wait_for
from tdac_envs.core.intake import TEXT_BYTES, parse_json, read_file

FIRST = 8.0
"""Places in the beginning."""
CUT = 0.5
LOOK_SECONDS = 0.2
"""Between two looks for a free place, about."""


class Gate:
    """Places before a provider.

    Args:
        folder: Shared by all who ask it; made where it is not there.
        most: Places at most.
        sleep: Waits.
    """

    def __init__(
        self, folder: Path, most: int, sleep: Callable[[float], None] = time.sleep
    ) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        self._most = float(max(most, 1))
        self._sleep = sleep

    @property
    def places(self) -> float:
        """How many may be asked at a time; what is behind the point is on its way."""
        return self._read()[0]

    @contextmanager
    def place(self) -> Generator[float]:
        """Waits for a place; yields when it was taken, for `limited`."""
        handle = self._free()
        while handle is None:
            self._sleep(random.uniform(0.5, 1.5) * LOOK_SECONDS)
            handle = self._free()
        try:
            yield time.time()
        finally:
            os.close(handle)

    def answered(self) -> None:
        """An answer came: one place more when all places have been answered once."""
        with wait_for(self._folder / "lock"):
            places, cut_at = self._read()
            self._write(min(self._most, places + 1.0 / places), cut_at)

    def limited(self, asked_at: float) -> None:
        """A rate limit: half of the places, once for all who asked before that."""
        with wait_for(self._folder / "lock"):
            places, cut_at = self._read()
            if asked_at > cut_at:
                self._write(max(1.0, CUT * places), time.time())

    def _free(self) -> int | None:
        """A descriptor that holds a place; None where all are taken."""
        for number in range(int(self.places)):
            file = self._folder / f"place-{number:03d}"
            handle = os.open(file, os.O_RDWR | os.O_CREAT, 0o644)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                os.close(handle)
                continue
            return handle
        return None

    def _read(self) -> tuple[float, float]:
        """Places, and when they were last cut."""
        with suppress(OSError, ValueError, KeyError, TypeError):
            known = parse_json(read_file(self._folder / "state.json", TEXT_BYTES))
            return min(self._most, float(known["places"])), float(known["cut_at"])
        return min(self._most, FIRST), 0.0

    def _write(self, places: float, cut_at: float) -> None:
        text = json.dumps({"places": round(places, 3), "cut_at": cut_at})
        write_atomic(self._folder / "state.json", text)


class Gated:
    """A provider behind a gate; see `Provider`.

    Args:
        model: The provider.
        gate: Its gate.
    """

    def __init__(self, model: Provider, gate: Gate) -> None:
        self.name = model.name
        self.paid = model.paid
        self.served_at = served_at(model)
        self.missing = missing_for(model)
        self._model = model
        self._gate = gate

    def complete(self, request: Request) -> Reply:
        """Answers one request; see `Provider`."""
        with self._gate.place() as asked_at:
            try:
                reply = self._model.complete(request)
            except RateLimited:
                self._gate.limited(asked_at)
                raise
        self._gate.answered()
        return reply


def gated(model: Provider, folder: Path, most: int) -> Provider:
    """A provider behind the gate of its vendor or server; a free one as it is."""
    if not model.paid:
        return model
    kind = model.name.partition(":")[0]
    name = slug(f"{kind}-{served_at(model) or ''}")
    return Gated(model, Gate(folder / name, most))
