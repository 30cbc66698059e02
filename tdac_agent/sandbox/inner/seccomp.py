"""Allow-list of system calls, enforced by the kernel; all others fail with EPERM."""

from __future__ import annotations

import ctypes
import errno
import os
import struct

from . import kernel, syscalls

_LOAD, _IF_EQUAL, _IF_AT_LEAST, _RETURN = 0x20, 0x15, 0x35, 0x06
_ALLOW, _KILL, _DENY = 0x7FFF0000, 0x80000000, 0x00050000 | errno.EPERM
_X32 = 0x40000000
_IOCTLS = (0x5401, 0x5413, 0x541B, 0x5421, 0x5450, 0x5451)
_FCNTLS = (0, 1, 2, 3, 1030)
# Wait, wake and requeue, with their bitset and wall-clock variants, all private.
_FUTEXES = (128, 129, 131, 132, 137, 138, 384, 393)
# Normal, random, sequential, not needed, free, huge pages or not: what malloc and numpy
# say of their own memory. Other advice moves pages of files that all children share.
_ADVICE = (0, 1, 2, 4, 8, 14, 15)
# The kernel's own clocks. Other numbers mean the CPU time of another process.
_CLOCKS = tuple(range(12))
# At most one of each of these can be pending. Those that queue count for the user.
_SIGNALS = tuple(range(32))

Instruction = tuple[int, int, int, int]


def apply(lifeline: int) -> None:
    """Restrict this process permanently.

    Args:
        lifeline: Descriptor that must stay open: through it the kernel kills the
            process when the judge has ended.

    Raises:
        OSError: The kernel does not have seccomp, or the processor is not supported.
    """
    install(program(lifeline))


def install(steps: list[Instruction]) -> None:
    """Have the kernel filter the calls of this process and of its children.

    Raises:
        OSError: The kernel does not have seccomp.
    """
    code = b"".join(struct.pack("<HBBI", *step) for step in steps)
    buffer = ctypes.create_string_buffer(code, len(code))
    pointer = struct.pack("@HP", len(code) // 8, ctypes.addressof(buffer))
    kernel.prctl(kernel.PR_SET_NO_NEW_PRIVS, 1)
    kernel.syscall("seccomp", 1, 0, ctypes.create_string_buffer(pointer, len(pointer)))


def program(lifeline: int) -> list[Instruction]:
    """Return the filter for this processor and process."""
    machine = os.uname().machine
    if machine not in syscalls.MACHINES:
        raise OSError(f"no table of system calls for {machine}")
    steps = [
        (_LOAD, 0, 0, 4),
        (_IF_EQUAL, 1, 0, syscalls.MACHINES[machine][1]),
        (_RETURN, 0, 0, _KILL),
        (_LOAD, 0, 0, 0),
        (_IF_AT_LEAST, 0, 1, _X32),
        (_RETURN, 0, 0, _KILL),
    ]
    for number in syscalls.allowed(machine):
        steps += [(_IF_EQUAL, 0, 1, number), (_RETURN, 0, 0, _ALLOW)]
    guards = _guards(lifeline)
    for name, number in syscalls.guarded(machine).items():
        steps += [(_IF_EQUAL, 0, len(guards[name]), number), *guards[name]]
    return [*steps, (_RETURN, 0, 0, _DENY)]


def _guards(lifeline: int) -> dict[str, list[Instruction]]:
    own = os.getpid()
    keeps_lifeline = [*_is_not(0, lifeline), (_RETURN, 0, 0, _ALLOW)]
    onto_lifeline = [*_is_not(1, lifeline), (_RETURN, 0, 0, _ALLOW)]
    to_itself = _one_of(0, (own,))
    of_itself = [*_one_of(0, (0, own)), (_RETURN, 0, 0, _ALLOW)]
    own_clock = [*_one_of(0, _CLOCKS), (_RETURN, 0, 0, _ALLOW)]
    return {
        "close": keeps_lifeline,
        "dup2": onto_lifeline,
        "dup3": onto_lifeline,
        "fcntl": [*_one_of(1, _FCNTLS), (_RETURN, 0, 0, _ALLOW)],
        "ioctl": [*_one_of(1, _IOCTLS), (_RETURN, 0, 0, _ALLOW)],
        "kill": [*to_itself, *_one_of(1, _SIGNALS), (_RETURN, 0, 0, _ALLOW)],
        "tgkill": [*to_itself, *_one_of(2, _SIGNALS), (_RETURN, 0, 0, _ALLOW)],
        "madvise": [*_one_of(2, _ADVICE), (_RETURN, 0, 0, _ALLOW)],
        "clock_gettime": own_clock,
        "clock_getres": own_clock,
        "clock_nanosleep": own_clock,
        "getpgid": of_itself,
        "getsid": of_itself,
        "sched_getaffinity": of_itself,
        "getpriority": [
            *_one_of(0, (0,)),
            *_one_of(1, (0, own)),
            (_RETURN, 0, 0, _ALLOW),
        ],
        # Only private futexes: shared ones could reach children that map the same file.
        "futex": [*_one_of(1, _FUTEXES), (_RETURN, 0, 0, _ALLOW)],
        # It may read its own limits, but set none.
        "prlimit64": [
            *_one_of(0, (0, own)),
            *_one_of(2, (0,)),
            *_one_of(2, (0,), high=True),
            (_RETURN, 0, 0, _ALLOW),
        ],
    }


def _one_of(
    argument: int, values: tuple[int, ...], high: bool = False
) -> list[Instruction]:
    steps = [(_LOAD, 0, 0, 16 + 8 * argument + 4 * high)]
    for index, value in enumerate(values):
        steps.append((_IF_EQUAL, len(values) - index, 0, value))
    return [*steps, (_RETURN, 0, 0, _DENY)]


def _is_not(argument: int, value: int) -> list[Instruction]:
    load = (_LOAD, 0, 0, 16 + 8 * argument)
    return [load, (_IF_EQUAL, 0, 1, value), (_RETURN, 0, 0, _DENY)]
