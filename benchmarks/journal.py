"""Answers of a long run, kept so that it can be taken up again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any


class Journal:
    """Answers by the text they are about; those of an earlier run are kept.

    Args:
        path: One line an answer; none is written without.
        about: What else the answers depend on, as text.
    """

    def __init__(self, path: Path | None, about: str) -> None:
        self._path = path
        self._about = about
        lines = path.read_text().splitlines() if path and path.exists() else []
        self._known: dict[str, Any] = dict(map(json.loads, lines))

    def answers(
        self, pool: ProcessPoolExecutor, ask: Callable[[Any], Any], items: Sequence[Any]
    ) -> Iterator[Any]:
        """The answer for each item, in order."""
        new = [item for item in items if self._key(item) not in self._known]
        fresh = zip(new, pool.map(ask, new), strict=True)
        for item in items:
            key = self._key(item)
            while key not in self._known:
                asked, answer = next(fresh)
                self._note(self._key(asked), answer)
            yield self._known[key]

    def _key(self, item: Any) -> str:
        return hashlib.sha256((self._about + item.text).encode()).hexdigest()[:16]

    def _note(self, key: str, answer: Any) -> None:
        self._known[key] = answer
        if self._path is not None:
            with self._path.open("a") as file:
                file.write(json.dumps([key, answer]) + "\n")
