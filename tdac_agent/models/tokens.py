"""Token counts of texts, estimated without a vendor's tokenizer."""

from __future__ import annotations

import math

WRAPPING = 64
"""Tokens that a vendor may add to a prompt."""
BYTES_PER_TOKEN = 3.0
"""Prose has about four, code and numbers about three; a lower value is safer."""

PICTURE_TOKENS = {"anthropic": 1_600, "openai": 25_600}
"""Upper bounds of the tokens of a picture of 1024 x 1024 px, by vendor.

Anthropic counts a token for each 28 x 28 px, 1,369, or for 750 px, 1,399, and at most
about 1,600 (platform.claude.com/docs/en/build-with-claude/vision). At OpenAI, models
that count 32 x 32 px take at most 2.46 x 1,024 = 2,520; the others scale the shorter
side to 768 px and count 512 x 512 px, here at most four times 170, and with gpt-4o-mini
2,833 + 4 x 5,667 = 25,501 (developers.openai.com/api/docs/guides/images-vision).
"""
MOST_PICTURE_TOKENS = max(PICTURE_TOKENS.values())
"""The bound for models of others."""


def picture_tokens(model: str) -> int:
    """Returns the upper bound of the tokens of a picture, by the name of the model."""
    return PICTURE_TOKENS.get(model.partition(":")[0], MOST_PICTURE_TOKENS)


def estimate_tokens(text: str) -> int:
    """Returns an estimate that is usually too high for English and code."""
    size = len(text.encode("utf-8", "surrogatepass"))
    return math.ceil(size / BYTES_PER_TOKEN)


def most_tokens(text: str) -> int:
    """Returns an upper bound for any tokenizer: no token is shorter than one byte."""
    return len(text.encode("utf-8", "surrogatepass")) + WRAPPING
