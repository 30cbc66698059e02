"""Progress of the present request, and how to stop it from another thread."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


class Stopped(Exception):
    """The server ends while it judges; the submission is judged at the next start."""


@dataclass(frozen=True, slots=True)
class Step:
    """How far the present request is.

    Attributes:
        progress: Increases with each step.
        total: Its value at the end; None if it is not known.
        message: The same in words.
    """

    progress: float
    total: float | None
    message: str


class Watch:
    """Follows the work of a request, and can stop it from another thread.

    Attributes:
        on_step: Called with each step of the present request; None for nobody.
    """

    def __init__(self) -> None:
        self.on_step: Callable[[Step], None] | None = None
        self._stopping = threading.Event()
        self._total: float | None
        self._began = time.monotonic()
        self._counts, self._total = False, None

    def begin(self, on_step: Callable[[Step], None] | None) -> None:
        """A request begins."""
        self.on_step, self._began = on_step, time.monotonic()
        self._counts = False

    def stop(self) -> None:
        """Ends the present request, and all later ones, with `Stopped`."""
        self._stopping.set()

    def poll(self) -> None:
        """Called repeatedly while the judge works; reports the time if none drives.

        Raises:
            Stopped: The server ends.
        """
        if self._stopping.is_set():
            raise Stopped
        if not self._counts:
            seconds = int(time.monotonic() - self._began)
            if seconds:
                self._tell(Step(seconds, None, f"judging for {seconds} s"))

    def record(self, record: dict[str, Any]) -> None:
        """Called with each record of the run."""
        if record["event"] == "drive.start":
            self._counts = True
            self._total = record.get("worlds", record.get("episodes"))
        elif record["event"] == "hidden.start":
            self._counts, self._total = True, None
        elif record["event"] == "drive.step":
            done = record["done"]
            self._tell(Step(done, self._total, f"{done} episodes driven"))

    def _tell(self, step: Step) -> None:
        if self.on_step is not None:
            self.on_step(step)
