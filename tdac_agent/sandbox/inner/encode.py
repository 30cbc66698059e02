"""Encode one value in the wire format."""

from __future__ import annotations

import struct
from collections.abc import Callable
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
    ODD_KEY,
    U32,
    Handle,
    RemoteError,
    WireError,
)

ARRAYS = [struct.Struct(f"<cBB{count}I") for count in range(MAX_DIMENSIONS + 1)]
BUILTINS = (dict, list, tuple, str, bytes, int, float)
# The last two are aliases of int64 and uint64 on Linux.
SCALARS = {*(dtype.type for dtype in DTYPES), np.longlong, np.ulonglong}

Keeper = Callable[[object], Handle]


class _Writer:
    __slots__ = ("add", "depth", "dict_room", "keep", "parts", "room")

    def __init__(self, keep: Keeper | None) -> None:
        self.parts: list[bytes] = []
        self.add = self.parts.append
        self.depth = MAX_DEPTH
        self.room = MAX_ITEMS
        self.dict_room = MAX_DICT_ITEMS
        self.keep = keep


def encode(value: object, keep: Keeper | None = None) -> bytes:
    """Encode one value.

    Args:
        value: Value to encode.
        keep: Called with each object that has no encoding; returns its handle.
            Without it, such an object is an error.

    Raises:
        WireError: The value is too deep, too large or has no encoding.
    """
    writer = _Writer(keep)
    _put(writer, value)
    return b"".join(writer.parts)


def _put(w: _Writer, value: Any) -> None:
    put = _PUT.get(type(value))
    if put is None:
        _put_other(w, value)
    else:
        put(w, value)


def _put_other(w: _Writer, value: Any) -> None:
    kind = type(value)
    for builtin in BUILTINS:
        if issubclass(kind, builtin):
            _put(w, _plain(builtin, value))
            return
    if w.keep is None:
        raise WireError(f"a {kind.__name__} cannot be sent")
    _put_handle(w, w.keep(value))


def _plain(builtin: Any, value: Any) -> Any:
    """Convert a subclass instance to the built-in type, bypassing its own methods."""
    if builtin is dict:
        return dict(dict.items(value))
    if builtin is list:
        return list(list.__iter__(value))
    if builtin is tuple:
        return tuple(tuple.__iter__(value))
    if builtin is int:
        return int.__add__(value, 0)
    if builtin is float:
        return float.__add__(value, -0.0)
    return builtin.__getitem__(value, slice(None))


def _put_constant(w: _Writer, value: bool | None) -> None:
    w.add(b"N" if value is None else b"T" if value else b"F")


def _put_int(w: _Writer, value: int) -> None:
    if -(1 << 63) <= value < 1 << 63:
        w.add(b"i" + I64.pack(value))
        return
    size = value.bit_length() // 8 + 1
    if size > MAX_INT_BYTES:
        raise WireError(f"an int of {size} bytes is too large (limit {MAX_INT_BYTES})")
    w.add(b"I" + U32.pack(size) + value.to_bytes(size, "little", signed=True))


def _put_float(w: _Writer, value: float) -> None:
    w.add(b"f" + F64.pack(value))


def _put_str(w: _Writer, value: str) -> None:
    data = value.encode("utf-8", "surrogatepass")
    w.add(b"s" + U32.pack(len(data)) + data)


def _put_bytes(w: _Writer, value: bytes) -> None:
    w.add(b"b" + U32.pack(len(value)) + value)


def _put_items(w: _Writer, tag: bytes, items: Any) -> None:
    w.room -= len(items)
    if w.room < 0:
        raise WireError(f"a value has more than {MAX_ITEMS} items")
    _descend(w)
    w.add(tag + U32.pack(len(items)))
    for item in items:
        _put(w, item)
    w.depth += 1


def _descend(w: _Writer) -> None:
    w.depth -= 1
    if w.depth < 0:
        raise WireError(f"a value is nested deeper than {MAX_DEPTH} levels")


def _put_list(w: _Writer, value: list[Any]) -> None:
    _put_items(w, b"l", value)


def _put_tuple(w: _Writer, value: tuple[Any, ...]) -> None:
    _put_items(w, b"t", value)


def _put_dict(w: _Writer, value: dict[Any, Any]) -> None:
    _count_keys(w, len(value))
    _descend(w)
    w.add(b"d" + U32.pack(len(value)))
    for key, item in value.items():
        room = w.room
        _put(w, key)
        if not isinstance(key, str):
            _count_keys(w, ODD_KEY * (1 + room - w.room) - 1)
        _put(w, item)
    w.depth += 1


def _count_keys(w: _Writer, count: int) -> None:
    w.dict_room -= count
    if w.dict_room < 0:
        most = f"{MAX_DICT_ITEMS} dict items (a non-string key counts {ODD_KEY})"
        raise WireError(f"a value has more than {most}")


def _put_array(w: _Writer, value: Any) -> None:
    w.room -= ARRAY_ITEMS
    if w.room < 0:
        raise WireError(f"a value has more than {MAX_ITEMS // ARRAY_ITEMS} arrays")
    code = CODES.get(value.dtype)
    shape = value.shape
    if code is None or len(shape) > MAX_DIMENSIONS:
        _put_other_array(w, value)
        return
    w.add(ARRAYS[len(shape)].pack(b"a", code, len(shape), *shape))
    w.add(value.tobytes())


def _put_other_array(w: _Writer, value: Any) -> None:
    """Encode an array in another byte order; all others have no encoding."""
    dtype = value.dtype.newbyteorder("<")
    if dtype in CODES and value.ndim <= MAX_DIMENSIONS:
        _put_array(w, value.astype(dtype))
    elif w.keep is None:
        raise WireError(f"a {value.ndim}-D array of {value.dtype} cannot be sent")
    else:
        _put_handle(w, w.keep(value))


def _put_scalar(w: _Writer, value: Any) -> None:
    w.add(b"n" + bytes((CODES[value.dtype],)) + value.tobytes())


def _put_handle(w: _Writer, value: Handle) -> None:
    w.add(b"h" + U32.pack(value.id))
    _put_str(w, value.type_name)


def _put_error(w: _Writer, value: RemoteError) -> None:
    w.add(b"e" + U32.pack(value.line))
    for text in (value.type_name, value.message, value.traceback):
        _put_str(w, text)


_PUT: dict[type, Callable[[_Writer, Any], None]] = {
    type(None): _put_constant,
    bool: _put_constant,
    int: _put_int,
    float: _put_float,
    str: _put_str,
    bytes: _put_bytes,
    list: _put_list,
    tuple: _put_tuple,
    dict: _put_dict,
    np.ndarray: _put_array,
    Handle: _put_handle,
    RemoteError: _put_error,
    **dict.fromkeys(SCALARS, _put_scalar),
}
