"""Machine code: made from LLVM's assembly, kept on disk, and linked."""

from __future__ import annotations

import contextlib
import ctypes
import functools
import hashlib
import os
import struct
import sys
import tempfile
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

# numba's helpers that only a failing function calls, and no kernel's caller needs.
_HELPERS = (
    "NRT_Allocate",
    "NRT_Free",
    "NRT_MemInfo_call_dtor",
    "NRT_adapt_ndarray_from_python",
    "numba_unpickle",
    "numba_do_raise",
    "numba_gil_ensure",
    "numba_gil_release",
    "numba_runtime_build_excinfo_struct",
)


def kept(
    name: str, about: Sequence[str], make: Callable[[], list[bytes]]
) -> list[bytes]:
    """Objects of machine code: from disk, or made and written there.

    Args:
        name: Of the file.
        about: Everything that the code follows from, but the machine.
        make: Makes it.
    """
    key = hashlib.sha256("\n".join([*about, *_here()]).encode()).hexdigest()[:20]
    file = cache_folder() / f"{name}-{key}.obj"
    objects = _read(file)
    if objects is None:
        _tell()
        objects = make()
        _write(file, objects)
    return objects


@functools.cache
def _tell() -> None:
    """Says on a terminal what takes so long, once a process."""
    if sys.stderr.isatty():
        told = "compiling for this machine; kept on disk for the next time …"
        print(told, file=sys.stderr, flush=True)


@functools.cache
def _here() -> list[str]:
    """What machine code depends on beside its source: the machine and what made it."""
    import llvmlite.binding as llvm

    features = ",".join(
        f"{k}{v}" for k, v in sorted(llvm.get_host_cpu_features().items())
    )
    return [sys.version, version("numba"), llvm.get_host_cpu_name(), repr(features)]


def assembled(text: str) -> bytes:
    """An object with the code of LLVM's assembly as it stands."""
    import llvmlite.binding as llvm

    return bytes(machine().emit_object(llvm.parse_assembly(text)))


def optimised(text: str) -> bytes:
    """An object with the code of LLVM's assembly, its functions inlined."""
    import llvmlite.binding as llvm

    target, module = machine(), llvm.parse_assembly(text)
    tuning = llvm.create_pipeline_tuning_options(speed_level=3)
    builder = llvm.create_pass_builder(target, tuning)
    builder.getModulePassManager().run(module, builder)
    return bytes(target.emit_object(module))


def machine() -> Any:
    """The processor that this process runs on; an engine takes it for its own."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), opt=3, reloc="default", codemodel="jitdefault"
    )


def link(objects: list[bytes], symbol: str) -> tuple[Any, int]:
    """An engine that holds the code, which must outlive it, and the entry's address."""
    import llvmlite.binding as llvm

    target = machine()
    stub = ctypes.cast(ctypes.CDLL(None).abort, ctypes.c_void_p).value
    for name in _HELPERS:
        if not llvm.address_of_symbol(name):
            llvm.add_symbol(name, stub)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target)
    for data in objects:
        engine.add_object_file(llvm.ObjectFileRef.from_data(data))
    engine.finalize_object()
    return (engine, objects), int(engine.get_function_address(symbol))


@functools.cache
def cache_folder() -> Path:
    """Where machine code is kept: beside the byte code, else in the user's cache."""
    beside = Path(__file__).parent / "__pycache__"
    own = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "tdac"
    for folder in (beside, own):
        with contextlib.suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                return folder
    return Path(tempfile.mkdtemp(prefix="tdac-cache-"))


def _write(path: Path, objects: list[bytes]) -> None:
    """Keeps objects, whole or not at all; a full disk is no reason to stop."""
    data = b"".join(struct.pack("<Q", len(each)) + each for each in objects)
    digest = hashlib.sha256(data).digest()
    with contextlib.suppress(OSError):
        handle, name = tempfile.mkstemp(dir=path.parent)
        with os.fdopen(handle, "wb") as file:
            file.write(digest + data)
        os.replace(name, path)


def _read(path: Path) -> list[bytes] | None:
    """What `_write` kept, or None."""
    try:
        data = path.read_bytes()
    except OSError:
        return None
    digest, data = data[:32], data[32:]
    if hashlib.sha256(data).digest() != digest:
        return None
    objects = []
    while data:
        (size,) = struct.unpack_from("<Q", data)
        objects.append(data[8 : 8 + size])
        data = data[8 + size :]
    return objects
