"""Landlock: the kernel permanently restricts the files that a process may open."""

from __future__ import annotations

import contextlib
import ctypes
import os
import stat
import struct
import sys

from . import kernel

_WRITE_FILE, _READ_FILE, _READ_DIR = 1 << 1, 1 << 2, 1 << 3
_REMOVE_DIR, _REMOVE_FILE = 1 << 4, 1 << 5
_MAKE_DIR, _MAKE_REG, _TRUNCATE = 1 << 7, 1 << 8, 1 << 14
READ = _READ_FILE | _READ_DIR
LIST = _READ_DIR
DEVICE = _READ_FILE | _WRITE_FILE
SCRATCH = (
    READ | _WRITE_FILE | _REMOVE_DIR | _REMOVE_FILE | _MAKE_DIR | _MAKE_REG | _TRUNCATE
)
_FILE_RIGHTS = _WRITE_FILE | _READ_FILE | _TRUNCATE


def is_offered() -> bool:
    """Return whether this kernel has Landlock."""
    try:
        return sys.platform == "linux" and _version() > 0
    except OSError:
        return False


def _version() -> int:
    return kernel.syscall("landlock_create_ruleset", None, 0, 1)


def apply(rights: list[tuple[str, int]]) -> None:
    """Deny access to all files except those below the given paths.

    Args:
        rights: (path, rights below it); a path that cannot be opened is left out.

    Raises:
        OSError: The kernel does not have Landlock.
    """
    abi = _version()
    ruleset = kernel.syscall("landlock_create_ruleset", *_ruleset(abi), 0)
    try:
        for path, granted in rights:
            with contextlib.suppress(FileNotFoundError, PermissionError):
                _grant(ruleset, path, granted & _known(abi))
        kernel.prctl(kernel.PR_SET_NO_NEW_PRIVS, 1)
        kernel.syscall("landlock_restrict_self", ruleset, 0)
    finally:
        os.close(ruleset)


def _known(abi: int) -> int:
    """Return all file rights that a version of the interface has."""
    bits = {1: 13, 2: 14, 3: 15, 4: 15}.get(abi, 16)
    return (1 << bits) - 1


def _ruleset(abi: int) -> tuple[ctypes.Array[ctypes.c_char], int]:
    """Return the ruleset with all file rights, TCP rights and scopes that exist."""
    words = [_known(abi), 0b11, 0b11][: 1 if abi < 4 else 2 if abi < 6 else 3]
    data = struct.pack(f"={len(words)}Q", *words)
    return ctypes.create_string_buffer(data, len(data)), len(data)


def _grant(ruleset: int, path: str, rights: int) -> None:
    descriptor = os.open(path, os.O_PATH | os.O_CLOEXEC)
    try:
        if not stat.S_ISDIR(os.fstat(descriptor).st_mode):
            rights &= _FILE_RIGHTS
        rule = struct.pack("=Qi", rights, descriptor)
        buffer = ctypes.create_string_buffer(rule, len(rule))
        kernel.syscall("landlock_add_rule", ruleset, 1, buffer, 0)
    finally:
        os.close(descriptor)
