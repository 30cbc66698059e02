"""SHA-256 hashes of bytes, texts, JSON values and files."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

from tdac_agent.storage.files import open_regular
from tdac_envs.core.hashing import sha256_of
from tdac_envs.core.intake import RECORD_BYTES, read_file

__all__ = [
    "number_of",
    "sha256_of",
    "sha256_of_file",
    "sha256_of_json",
    "sha256_of_large_file",
]


def sha256_of_json(value: object) -> str:
    """The hash of a value as JSON with sorted keys."""
    return sha256_of(json.dumps(value, sort_keys=True))


def sha256_of_file(path: Path, most: int = RECORD_BYTES) -> str:
    """The hash of a regular file; OSError if it has more than `most` bytes."""
    return sha256_of(read_file(path, most))


def sha256_of_large_file(path: Path) -> str:
    """The hash of a regular file of any size; a replay buffer can take gigabytes."""
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def number_of(text: str) -> int:
    """A number below 2^64 that follows from a text."""
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "big")
