"""Kernel calls that the standard library does not offer."""

from __future__ import annotations

import ctypes
import os

from . import syscalls

PR_SET_PDEATHSIG = 1
PR_SET_NO_NEW_PRIVS = 38

_libc = ctypes.CDLL(None, use_errno=True)


def syscall(name: str, *arguments: int | ctypes.Array[ctypes.c_char] | None) -> int:
    """Make one system call from the setup table.

    Raises:
        OSError: It failed, or this processor is not supported.
    """
    machine = os.uname().machine
    if machine not in syscalls.MACHINES:
        raise OSError(f"no table of system calls for {machine}")
    number = syscalls.setup(machine)[name]
    return _checked(name, _libc.syscall(ctypes.c_long(number), *map(_word, arguments)))


def prctl(option: int, value: int) -> None:
    """Set a property of this process."""
    _checked("prctl", _libc.prctl(option, *map(_word, (value, 0, 0, 0))))


def unshare(flags: int) -> None:
    """Move this process into new namespaces of the kinds in `flags`."""
    _checked("unshare", _libc.unshare(flags))


def mount(source: str, target: str, kind: str, flags: int, data: str = "") -> None:
    """Mount `source` at `target`."""
    words = [os.fsencode(text) for text in (source, target, kind)]
    result = _libc.mount(*words, ctypes.c_ulong(flags), os.fsencode(data))
    _checked(f"mount of {source or kind} at {target}", result)


def detach(target: str) -> None:
    """Unmount `target` and everything below it."""
    _checked("umount", _libc.umount2(os.fsencode(target), 2))


def can_open_socket() -> bool:
    """Return whether this process can open an internet socket."""
    descriptor = _libc.socket(2, 2, 0)
    if descriptor < 0:
        return False
    os.close(descriptor)
    return True


def _word(value: int | ctypes.Array[ctypes.c_char] | None) -> object:
    return ctypes.c_long(value) if isinstance(value, int) else value


def _checked(what: str, result: int) -> int:
    if result < 0:
        number = ctypes.get_errno()
        raise OSError(number, f"{what}: {os.strerror(number)}")
    return result
