"""How many tokens a text has, without a vendor's tokenizer."""

from __future__ import annotations

import math

WRAPPING = 64
"""Tokens that a vendor may put around a prompt."""
BYTES_PER_TOKEN = 3.0
"""Prose has about four, code and figures about three; the fewer, the safer."""


def estimate_tokens(text: str) -> int:
    """An estimate that is rather too high than too low for English and code."""
    size = len(text.encode("utf-8", "surrogatepass"))
    return math.ceil(size / BYTES_PER_TOKEN)


def most_tokens(text: str) -> int:
    """More than any tokenizer makes of a text: no token has less than one byte."""
    return len(text.encode("utf-8", "surrogatepass")) + WRAPPING
