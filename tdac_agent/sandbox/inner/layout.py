"""Fast encoding of a dict of arrays that is sent again and again."""

from __future__ import annotations

from typing import Any

import numpy as np

from .encode import encode


class Layout:
    """The encoded bytes of a dict of arrays, except for the numbers.

    Observations differ only in their numbers, so the rest is made and checked once.
    Values with another layout are left to `encode` and `decode`.

    Args:
        example: A dict of non-empty arrays in native byte order, with string keys.
    """

    def __init__(self, example: dict[str, Any]) -> None:
        whole = encode(example)
        self._fields: list[tuple[str, Any, tuple[int, ...], bytes, int]] = []
        position = 0
        for key, array in example.items():
            start = len(encode({key: array})) - 5 - array.nbytes
            # A dict begins with its tag and length.
            start += position if self._fields else 5
            fixed = whole[position:start]
            position = start + array.nbytes
            self._fields.append((key, array.dtype, array.shape, fixed, start))
        self._size = len(whole)

    @classmethod
    def of(cls, value: object) -> Layout | None:
        """Return the layout of a value, or None if it is not a suitable dict."""
        if type(value) is not dict or not value:
            return None
        for key, item in value.items():
            if type(key) is not str or type(item) is not np.ndarray:
                return None
            if not item.size or not item.dtype.isnative or item.dtype == np.bool_:
                return None
        return cls(value)

    def encode(self, value: dict[str, Any]) -> bytes | None:
        """Return the bytes of a value, or None if it does not have this layout."""
        if len(value) != len(self._fields):
            return None
        parts = []
        for key, dtype, shape, fixed, _ in self._fields:
            array = value.get(key)
            if type(array) is not np.ndarray or array.dtype is not dtype:
                return None
            if array.shape != shape:
                return None
            parts.append(fixed)
            parts.append(array.tobytes())
        return b"".join(parts)

    def decode(self, data: bytes) -> dict[str, Any] | None:
        """Return the value of these bytes, or None if they do not have this layout."""
        if len(data) != self._size:
            return None
        value = {}
        for key, dtype, shape, fixed, start in self._fields:
            if data[start - len(fixed) : start] != fixed:
                return None
            array = np.ndarray(shape, dtype, data, start)
            value[key] = array.copy()
        return value
