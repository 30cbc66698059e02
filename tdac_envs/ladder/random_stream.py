"""Random numbers of one purpose of one world, equal on all machines and versions.

NumPy guarantees the raw words of its bit generators, but not the streams of
`numpy.random.Generator`. So all numbers are made here, by integers only.
"""

from __future__ import annotations

import hashlib
import hmac
import json
from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")

SCHEMA = 1
"""Version of `world_key`."""
KEY_BYTES = 32
FRACTIONS = 1 << 16
"""Real numbers are multiples of 1 / FRACTIONS."""
_WORD = 64
_BLOCK = 256
_MASK = (1 << _WORD) - 1


def world_key(
    salt: bytes, set_hash: str, split: str, index: int, purpose: str
) -> bytes:
    """The key of the random numbers of one purpose of one world.

    Args:
        salt: Secret or public salt of the split.
        set_hash: SHA-256 of the resolved `set.yaml`, hexadecimal.
        split: Name of the split.
        index: Number of the world in its split.
        purpose: What the numbers are for: "world", "task", "noise", ...

    Returns:
        32 bytes: HMAC-SHA256 under the salt of the canonical JSON of
        [schema, set_hash, split, index, purpose].
    """
    parts = [SCHEMA, set_hash, split, int(index), purpose]
    text = json.dumps(parts, separators=(",", ":"), ensure_ascii=True)
    return hmac.new(salt, text.encode("ascii"), hashlib.sha256).digest()


def rounded(value: float) -> float:
    """The nearest multiple of 2**-16."""
    return round(value * FRACTIONS) / FRACTIONS


class RandomStream:
    """Random numbers from the 64-bit words of a Philox counter.

    The first half of the key is Philox's key. The second half is the upper half of its
    counter, so streams of different keys do not overlap.

    Args:
        key: 32 bytes, for example from `world_key`.

    Raises:
        ValueError: The key has another length.
    """

    def __init__(self, key: bytes) -> None:
        if len(key) != KEY_BYTES:
            raise ValueError(f"expected a key of {KEY_BYTES} bytes, got {len(key)}")
        low, high = (int.from_bytes(key[k : k + 16], "little") for k in (0, 16))
        self._bits = np.random.Philox(key=low, counter=high << 128)
        self._block: list[int] = []

    def word(self) -> int:
        """A whole number of 64 random bits."""
        if not self._block:
            self._block = self._bits.random_raw(_BLOCK).tolist()[::-1]
        return self._block.pop()

    def integer(self, low: int, high: int) -> int:
        """A whole number from `low` to `high`, both included, all equally likely.

        The upper word of `word * count`, with the few words rejected that would make
        some numbers likelier. Source: Lemire, Fast Random Integer Generation in an
        Interval, ACM TOMACS 29 (2019).

        Raises:
            ValueError: `high` is below `low`, or there are more than 2**64 numbers.
        """
        count = high - low + 1
        if not 1 <= count <= 1 << _WORD:
            raise ValueError(f"expected 1 to 2**64 numbers, got {low} to {high}")
        product = self.word() * count
        if product & _MASK < count:
            least = (1 << _WORD) % count
            while product & _MASK < least:
                product = self.word() * count
        return low + (product >> _WORD)

    def uniform(self, low: float, high: float) -> float:
        """A multiple of 2**-16 from `low` to `high`, both rounded and included."""
        first, last = round(low * FRACTIONS), round(high * FRACTIONS)
        return self.integer(first, last) / FRACTIONS

    def chance(self, probability: float) -> bool:
        """True with this probability, rounded to a multiple of 2**-16."""
        return self.word() >> (_WORD - 16) < round(probability * FRACTIONS)

    def chances(self, probability: float, shape: tuple[int, int]) -> NDArray[np.bool_]:
        """An array of independent results of `chance`."""
        count, known = shape[0] * shape[1], self._block[::-1][: shape[0] * shape[1]]
        del self._block[len(self._block) - len(known) :]
        fresh = np.asarray(self._bits.random_raw(count - len(known)), np.uint64)
        words = np.concatenate([np.array(known, np.uint64), fresh])
        threshold = np.uint64(round(probability * FRACTIONS))
        return np.asarray(words >> np.uint64(_WORD - 16) < threshold).reshape(shape)

    def choice(self, values: Sequence[T]) -> T:
        """One of the values, all equally likely.

        Raises:
            ValueError: There are no values.
        """
        return values[self.integer(0, len(values) - 1)]

    def shuffled(self, values: Sequence[T]) -> list[T]:
        """The values in random order, all orders equally likely."""
        mixed = list(values)
        for last in range(len(mixed) - 1, 0, -1):
            other = self.integer(0, last)
            mixed[last], mixed[other] = mixed[other], mixed[last]
        return mixed
