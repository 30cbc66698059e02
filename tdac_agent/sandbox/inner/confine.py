"""Apply the steps of a sandbox tier to this process, then check that they hold."""

from __future__ import annotations

import contextlib
import os
import resource
import signal
from collections.abc import Callable
from typing import Any

from . import kernel, landlock, namespaces, seccomp


def confine(setup: dict[str, Any]) -> dict[str, int]:
    """Apply `setup["steps"]` in order; return which promises hold.

    If a step has changed the process, the result also has `pid`, its ID outside.

    Args:
        setup: The judge's setup frame.

    Raises:
        OSError: A step is not possible on this machine.
    """
    facts: dict[str, int] = {}
    for step in setup["steps"]:
        facts |= _STEPS[step](setup) or {}
    os.chdir(setup["work"])
    return {
        **facts,
        "hides_files": _files_hidden([*setup["witnesses"], *setup["foreign"]]),
        "hides_names": not any(map(os.path.lexists, setup["witnesses"])),
        "denies_network": not kernel.can_open_socket(),
        "denies_processes": not _can_fork(),
    }


def _end_with_parent(setup: dict[str, Any]) -> None:
    """Have the kernel kill this process when its parent, the zygote, ends."""
    del setup
    kernel.prctl(kernel.PR_SET_PDEATHSIG, signal.SIGKILL)


def _limit_resources(setup: dict[str, Any]) -> None:
    limits = {
        resource.RLIMIT_AS: setup["memory_bytes"],
        resource.RLIMIT_NOFILE: setup["open_files"],
        resource.RLIMIT_FSIZE: setup["scratch_bytes"],
        resource.RLIMIT_CORE: 0,
        resource.RLIMIT_NPROC: 0,
    }
    for name, value in limits.items():
        _lower(name, value, value)
    seconds = setup["cpu_seconds"]
    # The soft limit sends SIGXCPU, which shows the reason; the hard one sends SIGKILL.
    _lower(resource.RLIMIT_CPU, seconds, seconds + 1)


def _lower(name: int, soft: int, hard: int) -> None:
    """Set a limit, or keep a lower one that this process was started with."""
    _, ceiling = resource.getrlimit(name)
    if ceiling != resource.RLIM_INFINITY:
        soft, hard = min(soft, ceiling), min(hard, ceiling)
    resource.setrlimit(name, (soft, hard))


def _limit_files(setup: dict[str, Any]) -> None:
    readable = [*setup["readable"], *setup["packages"], setup["work"], setup["site"]]
    landlock.apply(
        [
            *((path, landlock.READ) for path in readable),
            *((path, landlock.LIST) for path in setup["listable"]),
            *((path, landlock.DEVICE) for path in setup["devices"]),
            (setup["scratch"], landlock.SCRATCH),
        ]
    )


def _limit_files_if_offered(setup: dict[str, Any]) -> None:
    if landlock.is_offered():
        _limit_files(setup)


def _limit_system_calls(setup: dict[str, Any]) -> None:
    seccomp.apply(setup["lifeline"])


def _limit_system_calls_if_offered(setup: dict[str, Any]) -> None:
    with contextlib.suppress(OSError):
        seccomp.apply(setup["lifeline"])


def _files_hidden(witnesses: list[str]) -> bool:
    """Return whether none of these files, which exist outside, can be opened."""
    for path in witnesses:
        try:
            os.close(os.open(path, os.O_RDONLY))
        except OSError:
            continue
        return False
    return True


def _can_fork() -> bool:
    try:
        pid = os.fork()
    except OSError:
        return False
    if pid == 0:
        os._exit(0)
    os.waitpid(pid, 0)
    return True


_STEPS: dict[str, Callable[[dict[str, Any]], dict[str, int] | None]] = {
    "namespaces": namespaces.enter,
    "end with parent": _end_with_parent,
    "rlimits": _limit_resources,
    "landlock": _limit_files,
    "landlock if offered": _limit_files_if_offered,
    "seccomp": _limit_system_calls,
    "seccomp if offered": _limit_system_calls_if_offered,
}
