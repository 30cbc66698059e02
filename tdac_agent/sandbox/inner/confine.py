"""Apply the steps of a sandbox tier to this process, then check that they hold."""

from __future__ import annotations

import os
import resource
from typing import Any


def confine(setup: dict[str, Any]) -> dict[str, bool]:
    """Apply `setup["steps"]` in order and return what was found to hold.

    Args:
        setup: The judge's setup frame.
    """
    for step in setup["steps"]:
        _STEPS[step](setup)
    os.chdir(setup["work"])
    return {"files_hidden": _files_hidden(setup["witnesses"])}


def _limit_resources(setup: dict[str, Any]) -> None:
    limits = {
        resource.RLIMIT_AS: setup["memory_bytes"],
        resource.RLIMIT_NOFILE: setup["open_files"],
        resource.RLIMIT_FSIZE: setup["scratch_bytes"],
        resource.RLIMIT_CORE: 0,
        resource.RLIMIT_NPROC: 0,
    }
    for name, value in limits.items():
        resource.setrlimit(name, (value, value))
    seconds = setup["cpu_seconds"]
    # The first is a signal that says why; the second cannot be caught.
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))


def _files_hidden(witnesses: list[str]) -> bool:
    """Return whether none of some files that exist outside can be opened."""
    for path in witnesses:
        try:
            os.close(os.open(path, os.O_RDONLY))
        except OSError:
            continue
        return False
    return True


_STEPS = {"rlimits": _limit_resources}
