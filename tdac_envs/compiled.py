"""Compiled functions that start without their compiler.

numba compiles a function when it is first called on a machine; the machine code is
kept on disk, and every later process loads it with llvmlite alone. To import numba and
set it up costs over half a second a process, to load the code a few thousandths.
"""

from __future__ import annotations

import ctypes
import functools
import struct
import threading
from collections.abc import Callable
from types import FunctionType
from typing import Any, Generic, ParamSpec, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from tdac_envs.machine_code import assembled, kept, link

P = ParamSpec("P")
R = TypeVar("R")

# Names as numpy and numba have them, and what they are in LLVM as an argument.
_SCALARS = {"f8": "double", "i8": "i64"}
_DTYPES = {
    "b1": np.bool_,
    "u1": np.uint8,
    "f4": np.float32,
    "f8": np.float64,
    "i4": np.int32,
}
_DTYPES["i8"] = np.int64
_RESULT, _ERROR, _FIRST = 0, 1, 2
# Words of an array before its shape and strides.
_ARRAY = 5
_FORMS = {"f8": "d", "i8": "q"}
_RESULTS = {"f8": "<d", "f4": "<f", "i8": "<q", "b1": "<?"}
_LOCK = threading.RLock()


class Kernel(Generic[P, R]):
    """A function of numbers and C-contiguous arrays that is compiled when called.

    Kernels may call kernels. They allocate nothing and raise nothing.

    Args:
        function: Plain Python, as numba can compile it.
        signature: Types of the arguments and of the result, such as
            `"b1[:,:] f8[:] f8 -> b1"`; None for one that only kernels call, which
            runs as plain Python where anything else calls it.
    """

    def __init__(self, function: Callable[P, R], signature: str | None) -> None:
        functools.update_wrapper(self, function)
        self.function = function
        self.signature = signature
        self.name = function.__name__
        arguments, _, result = (signature or "").partition("->")
        self._types = [_Type(text) for text in arguments.split()]
        self._result = result.strip()
        forms = "".join(kind.form for kind in self._types)
        self._form = struct.Struct(f"<{_FIRST}q{forms}")
        self._memory = ctypes.c_char * self._form.size
        self._entry: Callable[[int], int] | None = None
        self._engine: Any = None

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        """Calls the function; arrays are converted where they have to be.

        Raises:
            TypeError: An array has another type and is to be written to.
        """
        if self.signature is None:
            return self.function(*args, **kwargs)
        packed, kept = self._pack(args)
        slots = self._memory.from_buffer_copy(packed)
        if self.load()(ctypes.addressof(slots)):
            raise ArithmeticError(f"{self.name} failed")
        del kept
        return cast(R, self._result_in(slots))

    def bind(self, *args: Any) -> Callable[[], None]:
        """The call with these arrays, ready to be made again and again.

        Numbers are passed in arrays; so is the result.
        """
        slots, kept = self.pack(args)
        entry, address = self.load(), slots.ctypes.data

        def call(_kept: object = (slots, kept)) -> None:
            if entry(address):
                raise ArithmeticError(f"{self.name} failed")

        return call

    def __reduce__(self) -> str:
        return self.name

    def _result_in(self, slots: Any) -> Any:
        form = _RESULTS.get(self._result)
        return struct.unpack_from(form, slots, 8 * _RESULT)[0] if form else None

    def pack(self, args: Any) -> tuple[NDArray[np.int64], list[Any]]:
        """The arguments as the compiled entry reads them, and what they point to."""
        packed, kept = self._pack(args)
        return np.frombuffer(packed, np.int64).copy(), kept

    def _pack(self, args: Any) -> tuple[bytes, list[Any]]:
        words: list[Any] = [0] * _FIRST
        kept: list[Any] = []
        if len(args) != len(self._types):
            wanted, given = len(self._types), len(args)
            raise TypeError(f"{self.name}: expected {wanted} arguments, got {given}")
        for value, kind in zip(args, self._types, strict=True):
            if kind.dimensions:
                words += kind.words(value, kept)
            else:
                words.append(value)
        return self._form.pack(*words), kept

    def load(self) -> Callable[[int], int]:
        """The compiled entry, which takes the address of packed arguments.

        It is not 0 on failure. Compiles where that has not been done.
        """
        if self._entry is None:
            with _LOCK:
                if self._entry is None:
                    module = self.__module__.rpartition(".")[2]
                    name = f"{module}.{self.name}"
                    objects = kept(name, self._about(), self._compile)
                    self._engine, address = link(objects, self._symbol())
                    kind = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p)
                    self._entry = kind(address)
        return self._entry

    def _symbol(self) -> str:
        return f"tdac_{self.name}"

    def _about(self) -> list[str]:
        """Everything that the machine code follows from, but the machine."""
        types = [str(kind) for kind in self._types]
        return [*_facts(self, set()), *types, self._result]

    def _compile(self) -> list[bytes]:
        """Objects with the compiled function and with the entry to it."""
        dispatcher = _jitted(self)
        signature = tuple(kind.numba() for kind in self._types)
        dispatcher.compile(signature)
        result = dispatcher.overloads[signature]
        code = result.library._get_compiled_object()
        name = result.fndesc.llvm_func_name
        return [code, _entry_object(self._symbol(), name, self._types)]


def kernel(signature: str | None = None) -> Callable[[Callable[P, R]], Kernel[P, R]]:
    """Makes a function a `Kernel`; a decorator."""
    return lambda function: Kernel(function, signature)


class _Type:
    """A type of a signature: `f8`, or `f4[:,:]`.

    Attributes:
        form: How `struct` packs a value of it into 64-bit words.
    """

    def __init__(self, text: str) -> None:
        self.text = text
        self.item, _, rest = text.partition("[")
        self.dimensions = rest.count(":")
        words = f"{_ARRAY + 2 * self.dimensions}q"
        self.form = words if self.dimensions else _FORMS[self.item]
        self.dtype = np.dtype(_DTYPES[self.item])

    def __str__(self) -> str:
        return self.text

    def words(self, value: Any, kept: list[Any]) -> list[int]:
        """An array as 64-bit words, in the order in which numba passes it."""
        array = value
        if not (
            isinstance(array, np.ndarray)
            and array.dtype == self.dtype
            and array.flags.c_contiguous
        ):
            array = np.ascontiguousarray(value, self.dtype)
        if array.ndim != self.dimensions:
            raise TypeError(f"expected {self.dimensions} dimensions, got {array.ndim}")
        kept.append(array)
        pointer = array.__array_interface__["data"][0]
        return [0, 0, array.size, array.itemsize, pointer, *array.shape, *array.strides]

    def llvm(self) -> list[str]:
        """LLVM's types of these words."""
        if not self.dimensions:
            return [_SCALARS[self.item]]
        return ["ptr", "ptr", "i64", "i64", "ptr", *["i64"] * (2 * self.dimensions)]

    def numba(self) -> Any:
        """Numba's type."""
        from numba import from_dtype, types

        item = from_dtype(self.dtype)
        return types.Array(item, self.dimensions, "C") if self.dimensions else item


def _facts(kernel: Kernel[Any, Any], seen: set[int]) -> list[str]:
    """What a kernel's code, those it calls and its constants say."""
    seen.add(id(kernel))
    code, scope = kernel.function.__code__, kernel.function.__globals__
    constants = code.co_consts[1:] if kernel.function.__doc__ else code.co_consts
    facts = [kernel.name, code.co_code.hex(), repr(code.co_varnames), repr(constants)]
    for name in code.co_names:
        value = scope.get(name)
        facts.append(name)
        if isinstance(value, Kernel) and id(value) not in seen:
            facts += _facts(value, seen)
        elif isinstance(value, int | float):
            facts.append(repr(value))
        elif isinstance(value, np.ndarray):
            facts.append(repr(value.tolist()))
    return facts


@functools.cache
def _jitted(kernel: Kernel[Any, Any]) -> Any:
    """Numba's dispatcher of a kernel, with those of the kernels that it calls."""
    from numba import njit

    function = kernel.function
    scope = dict(function.__globals__)
    for name in function.__code__.co_names:
        if isinstance(scope.get(name), Kernel):
            scope[name] = _jitted(scope[name])
    copy = FunctionType(function.__code__, scope, function.__name__)
    copy.__defaults__ = function.__defaults__
    return njit(copy, nogil=True)


def _entry_object(symbol: str, target: str, types: list[_Type]) -> bytes:
    """An object with a function that reads all arguments of `target` from memory."""
    lines, given = [], []
    kinds = [kind for each in types for kind in each.llvm()]
    for number, kind in enumerate(kinds):
        offset = 8 * (_FIRST + number)
        lines.append(f"%p{number} = getelementptr i8, ptr %slots, i64 {offset}")
        lines.append(f"%a{number} = load {kind}, ptr %p{number}")
        given.append(f"{kind} %a{number}")
    passed = ", ".join(["ptr %slots", "ptr %error", *given])
    declared = ", ".join(["ptr", "ptr", *kinds])
    body = "\n".join(lines)
    text = f"""
declare i32 @"{target}"({declared})
define i32 @{symbol}(ptr %slots) {{
%error = getelementptr i8, ptr %slots, i64 {8 * _ERROR}
{body}
%status = call i32 @"{target}"({passed})
ret i32 %status
}}
"""
    return assembled(text)
