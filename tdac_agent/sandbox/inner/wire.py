"""The wire format between the judge and a sandboxed child: tagged binary values.

A frame is a little-endian header (payload length u32, kind u8, sequence u32) and one
encoded value. A value is a tag byte and its content. The decoder turns any bytes into
a value or a `WireError`, in memory bounded by the number of bytes; it runs no code of
the sender. Exact types are kept: a numpy scalar comes back as the same numpy type.
Subclasses of built-in types (a named tuple, an `IntEnum`) come back as the built-in.
Type names and exception texts are bounded and printable.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

HEADER = struct.Struct("<IBI")
MAX_DEPTH = 32
MAX_ITEMS = 1_000_000
# Keys chosen to collide make a dict quadratic. String hashes have a secret seed; other
# keys, and the items in them, count ten times, so that decoding takes under a second.
MAX_DICT_ITEMS = 10_000
ODD_KEY = 10
# An array counts as this many items, since it is the slowest item to print.
ARRAY_ITEMS = 10
# Below CPython's limit of 4300 decimal digits, so that every int can be printed.
MAX_INT_BYTES = 1024
# With more dimensions numpy prints many items, even of a summarized array.
MAX_DIMENSIONS = 4
# Maximum characters of a name, and of any other text about an exception.
MAX_NAME, MAX_TEXT = 200, 2000

_INTEGERS = ("i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8")
DTYPES = tuple(np.dtype(c) for c in ("?", *_INTEGERS, "f2", "f4", "f8"))
CODES = {dtype: code for code, dtype in enumerate(DTYPES)}

U32 = struct.Struct("<I")
I64 = struct.Struct("<q")
F64 = struct.Struct("<d")


class Kind(IntEnum):
    """Kinds of frames: those of the judge, then those of the child."""

    SETUP = 1
    LOAD = 2
    GET = 3
    CALL = 4
    RESET = 5
    POLICY = 6
    RUN_EPISODE = 7
    ENV_REPLY = 8
    ENV_REFUSAL = 9
    CALL_EACH = 10
    RUN_PROGRAM = 11
    VALUE = 32
    ERROR = 33
    ENV_RESET = 34
    ENV_STEP = 35


class WireError(Exception):
    """Bytes that are not a value, or a value that cannot be sent."""


def printable(text: str, most: int) -> str:
    """Return at most `most` characters, with a mark for each unprintable one."""
    text = text[:most]
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c == "\n" else "\ufffd" for c in text)


def is_name(value: object) -> bool:
    """Return whether a value is a string that can be the name of a type or variable."""
    return type(value) is str and len(value) <= MAX_NAME and value.isprintable()


@dataclass(frozen=True, slots=True)
class Handle:
    """A reference to an object in the child.

    Attributes:
        id: Number of the object in that child.
        type_name: Name of its class, such as "OccMap2D" or "generator".
    """

    id: int
    type_name: str

    def __repr__(self) -> str:
        return f"<{self.type_name}>"


@dataclass(frozen=True, slots=True)
class RemoteError:
    """An exception that was raised in the controller.

    Attributes:
        type_name: Class of the exception.
        message: Its text.
        traceback: The controller's own lines, outermost first.
        line: Line of `controller.py` where it was raised, 0 if unknown.
    """

    type_name: str
    message: str
    traceback: str
    line: int
