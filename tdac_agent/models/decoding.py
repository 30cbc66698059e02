"""Decoding of answers that programs and people write."""

from __future__ import annotations

import codecs

# The longer mark of UTF-32 begins with that of UTF-16.
_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)


def decode_answer(data: bytes) -> str:
    """Returns a text in the encoding of its byte order mark, which is dropped.

    Without a mark it is UTF-8, or UTF-16 if every other byte at its start is 0, as in
    English and in code. What cannot be decoded becomes a replacement character.
    """
    for mark, encoding in _MARKS:
        if data.startswith(mark):
            return data.removeprefix(mark).decode(encoding, "replace")
    start = data[:8]
    if len(start) == 8 and not any(start[1::2]) and all(start[::2]):
        return data.decode("utf-16-le", "replace")
    if len(start) == 8 and not any(start[::2]) and all(start[1::2]):
        return data.decode("utf-16-be", "replace")
    return data.decode("utf-8", "replace")
