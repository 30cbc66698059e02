"""The weights in a file of `torch.save`, read as plain data.

Such a file is a zip file with a pickle, `NAME/data.pkl`, and one file for each storage,
`NAME/data/KEY`. Source: torch, "Serialization semantics". The pickle may only describe
tensors, and a tensor only what its storage holds, so that the size of the file bounds
the memory. Nothing of torch is needed, nor Python's own reader of pickles.
"""

from __future__ import annotations

import pickletools
from dataclasses import dataclass
from math import prod
from typing import Any

from tdac_envs.core.intake import one_line, read_zip

ITEM_BYTES = {"Float": 4, "Double": 8, "Half": 2, "BFloat16": 2}
"""Bytes of a number, by kind of storage."""
MOST_DIMENSIONS = 4
# Eight critics of 16 layers, with their targets, need 18,000.
_MOST_OPERATIONS = 30_000
_DICT, _TENSOR, _PARAMETER = (
    "collections OrderedDict",
    "torch._utils _rebuild_tensor_v2",
    "torch._utils _rebuild_parameter",
)
_STORAGES = {f"torch {kind}Storage": kind for kind in ITEM_BYTES}
_NAMES = {_DICT, _TENSOR, _PARAMETER, *_STORAGES}
_CONSTANTS = {"NONE": None, "NEWTRUE": True, "NEWFALSE": False}


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
    try:
        tensors = _PickleReader(parts, folder).read(parts[pickles[0]])
    # An invalid pickle may raise anything.
    except Exception as error:
        raise ValueError(one_line(error)) from None
    return _checked(tensors, len(file))


def _checked(tensors: Any, most: int) -> dict[str, Weights]:
    if not isinstance(tensors, dict):
        raise ValueError("expected tensors by name")
    if not all(isinstance(tensor, Weights) for tensor in tensors.values()):
        raise ValueError("its weights are not tensors by name")
    if sum(len(tensor.data) for tensor in tensors.values()) > most:
        raise ValueError("its tensors together are larger than the file")
    return tensors


@dataclass(frozen=True, slots=True)
class _Name:
    """One of `_NAMES`, which imports nothing."""

    text: str


@dataclass(frozen=True, slots=True)
class _Storage:
    kind: str
    data: memoryview


class _PickleReader:
    """Carries out the operations with which torch describes tensors, and no others.

    Only strings, names and tensors can be used again, and dictionaries keep nothing but
    tensors, so that what the pickle makes is a tree of small depth.
    """

    def __init__(self, parts: dict[str, bytes], folder: str) -> None:
        self._parts, self._folder = parts, folder
        # The last list has what came since the last mark.
        self._stacks: list[list[Any]] = [[]]
        self._memo: dict[object, str | _Name | Weights] = {}

    def read(self, pickled: bytes) -> object:
        """Returns what a pickle describes."""
        for count, (operation, argument, _) in enumerate(pickletools.genops(pickled)):
            if count >= _MOST_OPERATIONS:
                raise ValueError(
                    f"more than {_MOST_OPERATIONS} operations in its data.pkl"
                )
            if operation.name in {"BINPUT", "LONG_BINPUT"}:
                self._remember(argument)
            elif operation.name == "MARK":
                self._stacks.append([])
            elif operation.name == "BUILD":
                # The state of a dictionary, which torch's modules use, is dropped.
                self._stacks[-1].pop()
            elif operation.name in {"SETITEM", "SETITEMS"}:
                self._set(self._taken(2 if operation.name == "SETITEM" else None))
            elif operation.name not in {"PROTO", "STOP"}:
                made = self._made(operation.name, argument)
                self._stacks[-1].append(made)
        return self._stacks[-1].pop()

    def _made(self, operation: str, argument: Any) -> object:
        """Returns what an operation puts on the stack."""
        match operation:
            case "NONE" | "NEWTRUE" | "NEWFALSE":
                made: object = _CONSTANTS[operation]
            case "BININT" | "BININT1" | "BININT2" | "LONG1" | "BINUNICODE":
                made = argument
            case "EMPTY_DICT":
                made = {}
            case "EMPTY_TUPLE":
                made = ()
            case "TUPLE":
                made = _tuple(self._taken())
            case "TUPLE1" | "TUPLE2" | "TUPLE3":
                made = _tuple(self._taken(int(operation[-1])))
            case "GLOBAL" if argument in _NAMES:
                made = _Name(argument)
            case "BINGET" | "LONG_BINGET":
                made = self._remembered(argument)
            case "BINPERSID":
                made = self._storage(self._stacks[-1].pop())
            case "REDUCE":
                made = _called(*self._taken(2))
            case _:
                shown = argument if operation == "GLOBAL" else operation
                raise ValueError(f"holds more than weights: {shown}")
        return made

    def _taken(self, count: int | None = None) -> list[Any]:
        """Takes the last values from the stack, or all since the last mark."""
        if count is None:
            return self._stacks.pop()
        return [self._stacks[-1].pop() for _ in range(count)][::-1]

    def _remember(self, number: object) -> None:
        value = self._stacks[-1][-1]
        self._memo.pop(number, None)
        if isinstance(value, str | _Name | Weights):
            self._memo[number] = value

    def _remembered(self, number: object) -> object:
        if number not in self._memo:
            raise ValueError(
                "its data.pkl uses again what is no string, name or tensor"
            )
        return self._memo[number]

    def _set(self, items: list[Any]) -> None:
        held = self._stacks[-1][-1]
        for key, value in zip(items[::2], items[1::2], strict=True):
            if not (isinstance(held, dict) and isinstance(key, str)):
                raise ValueError("its weights are not tensors by name")
            held[key] = value if isinstance(value, Weights) else None

    def _storage(self, described: object) -> _Storage:
        match described:
            case ("storage", _Name(name), str(key), str(), int(count)):
                kind = _STORAGES[name]
            case _:
                raise ValueError("a storage is not described as torch does")
        size, data = ITEM_BYTES[kind] * count, self._parts[f"{self._folder}/{key}"]
        if not 0 < size <= len(data):
            raise ValueError(f"storage {key} claims {size} bytes, and has {len(data)}")
        return _Storage(kind, memoryview(data)[:size])


def _tuple(items: list[Any]) -> tuple[Any, ...]:
    """Returns a tuple; the arguments of a tensor have tuples of numbers."""
    inner = (part for item in items if isinstance(item, tuple) for part in item)
    if any(isinstance(part, tuple) for part in inner):
        raise ValueError("its data.pkl nests tuples too deeply")
    return tuple(items)


def _called(function: object, arguments: object) -> object:
    """Returns what one of the names makes of arguments."""
    match function, arguments:
        case _Name(text), () if text == _DICT:
            return {}
        case (
            _Name(text),
            (_Storage() as storage, int(offset), tuple(shape), tuple(strides), *_),
        ) if text == _TENSOR:
            return _tensor(storage, offset, shape, strides)
        case _Name(text), (Weights() as tensor, *_) if text == _PARAMETER:
            return tensor
    raise ValueError("holds more than weights: an unknown call")


def _tensor(
    storage: _Storage, offset: int, shape: tuple[Any, ...], strides: tuple[Any, ...]
) -> Weights:
    """Returns a tensor that is stored in full."""
    if len(shape) > MOST_DIMENSIONS or not all(
        type(size) is int and size > 0 for size in shape
    ):
        raise ValueError(f"a tensor of {len(shape)} dimensions, or of none")
    dense = [prod(shape[axis + 1 :]) for axis in range(len(shape))]
    rows = zip(shape, strides, dense, strict=True)
    if any(size > 1 and stride != step for size, stride, step in rows):
        raise ValueError("a tensor does not store each of its numbers")
    item = ITEM_BYTES[storage.kind]
    begin, end = item * offset, item * (offset + prod(shape))
    if not 0 <= begin < end <= len(storage.data):
        raise ValueError("a tensor reaches beyond its storage")
    return Weights(storage.kind, shape, storage.data[begin:end])
