"""Token counts of texts, estimated without a vendor's tokenizer."""

from __future__ import annotations

import math

WRAPPING = 64
"""Tokens that a vendor may add to a prompt."""
BYTES_PER_TOKEN = 3.0
"""Prose has about four, code and numbers about three; a lower value is safer."""


def estimate_tokens(text: str) -> int:
    """Returns an estimate that is usually too high for English and code."""
    size = len(text.encode("utf-8", "surrogatepass"))
    return math.ceil(size / BYTES_PER_TOKEN)


def most_tokens(text: str) -> int:
    """Returns an upper bound for any tokenizer: no token is shorter than one byte."""
    return len(text.encode("utf-8", "surrogatepass")) + WRAPPING
