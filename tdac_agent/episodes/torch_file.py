"""The weights in a file of `torch.save`, read as plain data.

Such a file is a zip file with a pickle, `NAME/data.pkl`, and one file for each storage,
`NAME/data/KEY`. Source: torch, "Serialization semantics". The pickle may only describe
tensors, and a tensor only what its storage holds, so that the size of the file bounds
the memory. Nothing of torch is needed.
"""

from __future__ import annotations

import io
import pickle
import pickletools
from collections import OrderedDict
from dataclasses import dataclass
from math import prod
from typing import Any

from tdac_envs.core.intake import one_line, read_zip

ITEM_BYTES = {"Float": 4, "Double": 8, "Half": 2, "BFloat16": 2}
"""Bytes of a number, by kind of storage."""
MOST_DIMENSIONS = 4
# Eight critics of 16 layers, with their targets, need 18,000. More could nest tuples so
# deeply that hashing them overflows the stack.
_MOST_OPERATIONS = 30_000
_OPERATIONS = {
    *("PROTO", "STOP", "MARK", "NONE", "NEWTRUE", "NEWFALSE"),
    *("BININT", "BININT1", "BININT2", "LONG1", "BINUNICODE"),
    *("EMPTY_DICT", "SETITEM", "SETITEMS"),
    *("EMPTY_TUPLE", "TUPLE", "TUPLE1", "TUPLE2", "TUPLE3"),
    *("GLOBAL", "BINPERSID", "REDUCE", "BUILD"),
    *("BINPUT", "BINGET", "LONG_BINPUT", "LONG_BINGET"),
}


@dataclass(frozen=True, slots=True)
class Weights:
    """One tensor.

    Attributes:
        kind: Kind of its numbers, a key of `ITEM_BYTES`.
        shape: Its shape, all sizes above 0.
        data: Its numbers in C order, little-endian.
    """

    kind: str
    shape: tuple[int, ...]
    data: memoryview


def read_weights(file: bytes) -> dict[str, Weights]:
    """Returns the tensors in a torch file by name.

    Raises:
        ValueError: The file is damaged, holds anything else, or its tensors together
            are larger than the file.
    """
    # torch does not compress, so the parts are not larger than the file.
    parts = read_zip(file, len(file))
    pickles = [name for name in parts if name.endswith("/data.pkl")]
    if len(pickles) != 1:
        raise ValueError(f"expected one data.pkl, got {len(pickles)}")
    folder = pickles[0].removesuffix(".pkl")
    if parts.get(f"{folder.removesuffix('data')}byteorder", b"little") != b"little":
        raise ValueError("its numbers are not little-endian")
    pickled = parts[pickles[0]]
    _check_operations(pickled)
    try:
        found = _Reader(pickled, parts, folder).load()
    # An invalid pickle may raise anything.
    except Exception as error:
        raise ValueError(one_line(error)) from None
    return _checked(found, len(file))


def _checked(found: Any, most: int) -> dict[str, Weights]:
    if not isinstance(found, dict):
        raise ValueError("expected tensors by name")
    for name, tensor in found.items():
        if not (isinstance(name, str) and isinstance(tensor, Weights)):
            raise ValueError("its weights are not tensors by name")
    if sum(len(tensor.data) for tensor in found.values()) > most:
        raise ValueError("its tensors together are larger than the file")
    return dict(found)


def _check_operations(pickled: bytes) -> None:
    """Checks that a pickle only describes tensors, before anything reads it."""
    for count, (operation, argument, _) in enumerate(pickletools.genops(pickled)):
        if count >= _MOST_OPERATIONS:
            raise ValueError(f"more than {_MOST_OPERATIONS} operations in its data.pkl")
        name = str(argument) if operation.name == "GLOBAL" else operation.name
        if name not in _OPERATIONS and name not in _MEANINGS:
            raise ValueError(f"holds more than weights: {name}")
        # Python's reader makes a table of that size.
        if operation.name == "LONG_BINPUT" and int(str(argument)) > _MOST_OPERATIONS:
            raise ValueError(f"number {argument} of its data.pkl is out of range")


class _Reader(pickle.Unpickler):
    """Reads the pickle; names mean what `_MEANINGS` says, and import nothing."""

    def __init__(self, pickled: bytes, parts: dict[str, bytes], folder: str) -> None:
        super().__init__(io.BytesIO(pickled))
        self._parts, self._folder = parts, folder

    def find_class(self, module: str, name: str) -> Any:
        return _MEANINGS[f"{module} {name}"]

    def persistent_load(self, pid: Any) -> tuple[str, memoryview]:
        """Returns kind and bytes of a storage."""
        _, kind, key, _, count = pid
        size, data = ITEM_BYTES[kind] * count, self._parts[f"{self._folder}/{key}"]
        if not 0 < size <= len(data):
            raise ValueError(f"storage {key} claims {size} bytes, and has {len(data)}")
        return kind, memoryview(data)[:size]


class _Tensor:
    """Stands for `torch._utils._rebuild_tensor_v2`; without state to change."""

    __slots__ = ()

    def __call__(
        self,
        storage: tuple[str, memoryview],
        offset: int,
        shape: tuple[int, ...],
        strides: tuple[int, ...],
        *_: Any,
    ) -> Weights:
        """Returns a tensor that is stored in full."""
        kind, data = storage
        if len(shape) > MOST_DIMENSIONS or not all(size > 0 for size in shape):
            raise ValueError(f"a tensor of {len(shape)} dimensions, or of none")
        dense = [prod(shape[axis + 1 :]) for axis in range(len(shape))]
        rows = zip(shape, strides, dense, strict=True)
        if any(size > 1 and stride != step for size, stride, step in rows):
            raise ValueError("a tensor does not store each of its numbers")
        item = ITEM_BYTES[kind]
        begin, end = item * offset, item * (offset + prod(shape))
        if not 0 <= begin < end <= len(data):
            raise ValueError("a tensor reaches beyond its storage")
        return Weights(kind, tuple(shape), data[begin:end])


class _Parameter:
    """Stands for `torch._utils._rebuild_parameter`."""

    __slots__ = ()

    def __call__(self, tensor: Weights, *_: Any) -> Weights:
        """Returns the tensor."""
        return tensor


_MEANINGS: dict[str, Any] = {
    "collections OrderedDict": OrderedDict,
    "torch._utils _rebuild_tensor_v2": _Tensor(),
    "torch._utils _rebuild_parameter": _Parameter(),
    **{f"torch {kind}Storage": kind for kind in ITEM_BYTES},
}
