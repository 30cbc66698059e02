"""The hash by which files, texts and arrays are told apart."""

from __future__ import annotations

import hashlib


def sha256_of(*parts: str | bytes) -> str:
    """SHA-256 of some parts, one after the other, as 64 hexadecimal digits.

    Text counts as UTF-8; lone surrogates are allowed.
    """
    found = hashlib.sha256()
    for part in parts:
        raw = part.encode("utf-8", "surrogatepass") if isinstance(part, str) else part
        found.update(raw)
    return found.hexdigest()
