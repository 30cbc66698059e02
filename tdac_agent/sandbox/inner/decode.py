"""Decode one value of the wire format from untrusted bytes."""

from __future__ import annotations

import struct
from collections.abc import Callable
from math import prod
from typing import Any

import numpy as np

from .wire import (
    ARRAY_ITEMS,
    CODES,
    DTYPES,
    F64,
    I64,
    MAX_DEPTH,
    MAX_DICT_ITEMS,
    MAX_DIMENSIONS,
    MAX_INT_BYTES,
    MAX_ITEMS,
    MAX_TEXT,
    ODD_KEY,
    U32,
    Handle,
    RemoteError,
    WireError,
    is_name,
    printable,
)

# Two floats in a tuple or a list: the most frequent answer.
PAIR = struct.Struct("<cIcdcd")
SIZES = [dtype.itemsize for dtype in DTYPES]
BOOL = CODES[np.dtype(np.bool_)]
SHAPES = [struct.Struct(f"<{count}I") for count in range(MAX_DIMENSIONS + 1)]
Resolver = Callable[[Handle], object]


class _Cursor:
    __slots__ = ("data", "depth", "dict_room", "pos", "resolve", "room")

    def __init__(self, data: bytes, pos: int, resolve: Resolver | None) -> None:
        self.data = data
        self.pos = pos
        self.resolve = resolve
        self.depth = MAX_DEPTH
        self.room = MAX_ITEMS
        self.dict_room = MAX_DICT_ITEMS


def decode(data: bytes, pos: int = 0, resolve: Resolver | None = None) -> Any:
    """Decode the one value that `data` contains from `pos` to its end.

    Args:
        data: The bytes.
        pos: Start of the value.
        resolve: Returns the object behind a handle; without it handles stay handles.

    Raises:
        WireError: The bytes are not exactly one value.
    """
    if len(data) - pos == PAIR.size:
        outer, count, first, left, second, right = PAIR.unpack_from(data, pos)
        if count == 2 and first == b"f" and second == b"f":
            if outer == b"t":
                return left, right
            if outer == b"l":
                return [left, right]
    reader = _Cursor(data, pos, resolve)
    try:
        value = _take(reader)
    except (struct.error, KeyError, IndexError, ValueError, TypeError) as error:
        raise WireError(f"not a value: {error}") from None
    if reader.pos != len(data):
        raise WireError(f"{len(data) - reader.pos} extra bytes after a value")
    return value


def _take(r: _Cursor) -> Any:
    tag = r.data[r.pos]
    r.pos += 1
    return _TAKE[tag](r)


def _cut(r: _Cursor, size: int) -> bytes:
    end = r.pos + size
    if end > len(r.data):
        raise WireError(f"expected {size} bytes, got {len(r.data) - r.pos}")
    part = r.data[r.pos : end]
    r.pos = end
    return part


def _take_u32(r: _Cursor) -> int:
    (number,) = U32.unpack_from(r.data, r.pos)
    r.pos += 4
    return int(number)


def _take_constant(r: _Cursor) -> bool | None:
    return _CONSTANTS[r.data[r.pos - 1]]


def _take_int(r: _Cursor) -> int:
    (number,) = I64.unpack_from(r.data, r.pos)
    r.pos += 8
    return int(number)


def _take_big_int(r: _Cursor) -> int:
    size = _take_u32(r)
    if size > MAX_INT_BYTES:
        raise WireError(f"an int of {size} bytes")
    return int.from_bytes(_cut(r, size), "little", signed=True)


def _take_float(r: _Cursor) -> float:
    (number,) = F64.unpack_from(r.data, r.pos)
    r.pos += 8
    return float(number)


def _take_str(r: _Cursor) -> str:
    return _cut(r, _take_u32(r)).decode("utf-8", "surrogatepass")


def _take_bytes(r: _Cursor) -> bytes:
    return _cut(r, _take_u32(r))


def _take_list(r: _Cursor) -> list[Any]:
    count = _take_u32(r)
    r.room -= count
    r.depth -= 1
    if r.depth < 0 or r.room < 0:
        raise WireError("a value is nested too deep or has too many items")
    value = [_take(r) for _ in range(count)]
    r.depth += 1
    return value


def _take_tuple(r: _Cursor) -> tuple[Any, ...]:
    return tuple(_take_list(r))


def _take_dict(r: _Cursor) -> dict[Any, Any]:
    count = _take_u32(r)
    r.dict_room -= count
    r.depth -= 1
    if r.depth < 0 or r.dict_room < 0:
        raise WireError("a value is nested too deep or has too many dict items")
    value = {_take_key(r): _take(r) for _ in range(count)}
    r.depth += 1
    if len(value) != count:
        raise WireError("a dict with the same key twice")
    return value


def _take_key(r: _Cursor) -> Any:
    room = r.room
    key = _take(r)
    if type(key) is not str:
        r.dict_room -= ODD_KEY * (1 + room - r.room) - 1
        if r.dict_room < 0:
            raise WireError("a value has too many dict items")
    return key


def _take_array(r: _Cursor) -> Any:
    data, pos = r.data, r.pos
    r.room -= ARRAY_ITEMS
    if r.room < 0:
        raise WireError("a value has too many arrays")
    code, dimensions = data[pos], data[pos + 1]
    if dimensions > MAX_DIMENSIONS:
        raise WireError(f"an array of {dimensions} dimensions")
    shape = SHAPES[dimensions].unpack_from(data, pos + 2)
    pos += 2 + 4 * dimensions
    count = prod(shape)
    r.pos = pos + count * SIZES[code]
    if r.pos > len(data):
        raise WireError("an array is longer than its frame")
    if count == 0:
        return np.zeros(shape, DTYPES[code])
    array = _numbers(data, code, count, pos).copy()
    return array if dimensions == 1 else array.reshape(shape)


def _take_scalar(r: _Cursor) -> Any:
    code = r.data[r.pos]
    r.pos += 1
    return _numbers(_cut(r, SIZES[code]), code, 1, 0)[0]


def _numbers(data: bytes, code: int, count: int, start: int) -> Any:
    if code == BOOL and np.frombuffer(data, np.uint8, count, start).max() > 1:
        raise WireError("a bool that is neither 0 nor 1")
    return np.frombuffer(data, DTYPES[code], count, start)


def _take_handle(r: _Cursor) -> object:
    number = _take_u32(r)
    handle = Handle(number, _take_name(r))
    return handle if r.resolve is None else r.resolve(handle)


def _take_error(r: _Cursor) -> RemoteError:
    line = _take_u32(r)
    return RemoteError(_take_name(r), _take_text(r), _take_text(r), line)


def _take_name(r: _Cursor) -> str:
    name = _take_text(r)
    if not is_name(name):
        raise WireError("a string that is too long or cannot be printed")
    return name


def _take_text(r: _Cursor) -> str:
    if r.data[r.pos] != ord("s"):
        raise WireError("expected a string")
    r.pos += 1
    text = _take_str(r)
    if printable(text, MAX_TEXT) != text:
        raise WireError("a string that is too long or cannot be printed")
    return text


_CONSTANTS = {ord("N"): None, ord("T"): True, ord("F"): False}
_TAKE: dict[int, Callable[[_Cursor], Any]] = {
    **dict.fromkeys(_CONSTANTS, _take_constant),
    ord("i"): _take_int,
    ord("I"): _take_big_int,
    ord("f"): _take_float,
    ord("s"): _take_str,
    ord("b"): _take_bytes,
    ord("l"): _take_list,
    ord("t"): _take_tuple,
    ord("d"): _take_dict,
    ord("a"): _take_array,
    ord("n"): _take_scalar,
    ord("h"): _take_handle,
    ord("e"): _take_error,
}
