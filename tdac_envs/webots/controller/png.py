"""Writes PNG files (ISO/IEC 15948) with the standard library alone."""

from __future__ import annotations

import struct
import zlib


def png(image: bytes, width: int, height: int) -> bytes:
    """The content of a PNG file.

    Args:
        image: Blue, green, red and a fourth byte of each pixel, row by row.
        width: Width, pixels.
        height: Height, pixels.
    """
    rgb = bytearray(3 * width * height)
    rgb[::3], rgb[1::3], rgb[2::3] = image[2::4], image[1::4], image[::4]
    row = 3 * width
    # Each row begins with the number of its filter, 0: none.
    rows = b"".join(b"\0" + rgb[at : at + row] for at in range(0, len(rgb), row))
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(*chunk) for chunk in chunks)


def _chunk(kind: bytes, data: bytes) -> bytes:
    check = struct.pack(">I", zlib.crc32(kind + data))
    return struct.pack(">I", len(data)) + kind + data + check
