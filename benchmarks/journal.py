"""A journal of a long run's results, from which the run can be resumed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any


class Journal:
    """Stored results, including those of an earlier run, by the text of their item.

    Args:
        path: File with one line per result, or None to keep none.
        about: Text of everything else that the results depend on.
    """

    def __init__(self, path: Path | None, about: str) -> None:
        self._path = path
        self._about = about
        lines = path.read_text().splitlines() if path and path.exists() else []
        self._known: dict[str, Any] = dict(map(json.loads, lines))

    def answers(
        self, pool: ProcessPoolExecutor, ask: Callable[[Any], Any], items: Sequence[Any]
    ) -> Iterator[Any]:
        """The result for each item, in order; each is recorded as soon as possible."""
        keys = [self._key(item) for item in items]
        asked: dict[str, Future[Any]] = {}
        for key, item in zip(keys, items, strict=True):
            if key not in self._known and key not in asked:
                asked[key] = pool.submit(ask, item)
                asked[key].add_done_callback(partial(self._note, key))
        for key in keys:
            yield asked[key].result() if key in asked else self._known[key]

    def _key(self, item: Any) -> str:
        return hashlib.sha256((self._about + item.text).encode()).hexdigest()[:16]

    def _note(self, key: str, asked: Future[Any]) -> None:
        if self._path is None or asked.cancelled() or asked.exception() is not None:
            return
        with self._path.open("a") as file:
            file.write(json.dumps([key, asked.result()]) + "\n")
