"""Texts stored under their hash, each completely or not at all."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.hashes import sha256_of
from tdac_envs.core.intake import RECORD_BYTES, read_file


@dataclass(frozen=True, slots=True)
class Blobs:
    """A folder of texts, each in a file named by its SHA-256 hash.

    Attributes:
        folder: The folder; created when the first text is stored.
    """

    folder: Path

    def put(self, text: str) -> str:
        """Stores a text and returns its hash."""
        raw = text.encode("utf-8", "surrogatepass")
        name = sha256_of(raw)
        if self.get(name) is None:
            self.folder.mkdir(parents=True, exist_ok=True)
            write_atomic(self.folder / name, raw)
        return name

    def get(self, name: str) -> str | None:
        """Returns the text with this hash, or None if it is missing or damaged."""
        try:
            raw = read_file(self.folder / name, RECORD_BYTES)
        except OSError:
            return None
        if sha256_of(raw) != name:
            return None
        return raw.decode("utf-8", "surrogatepass")
