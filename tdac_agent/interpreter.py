"""Starts Python so that no module comes from the folder in which a process works.

That folder may be somebody else's. With `-m` and `-c`, Python looks there for modules
first, before its own library; with an empty or relative entry of PYTHONPATH, too.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping

SAFE, PATHS = "PYTHONSAFEPATH", "PYTHONPATH"
OURS = "tdac"
"""Value of PYTHONSAFEPATH if it is ours: Python takes any that is not empty."""
GIVEN = "TDAC_GIVEN_PYTHONPATH"
"""Variable that keeps the user's PYTHONPATH."""


def python(*words: str) -> list[str]:
    """The command that starts this Python with some words."""
    return [sys.executable, "-P", *words]


def safe_environment(given: Mapping[str, str] = os.environ) -> dict[str, str]:
    """An environment for Python processes, and for those that they start.

    Args:
        given: The environment to begin with.
    """
    safe = dict(given)
    safe[SAFE] = safe.get(SAFE) or OURS
    paths = safe.pop(PATHS, "").split(os.pathsep)
    kept = [path for path in paths if os.path.isabs(path)]
    if kept:
        safe[PATHS] = os.pathsep.join(kept)
    if kept != paths and PATHS in given:
        safe.setdefault(GIVEN, given[PATHS])
    return safe


def given_environment(safe: Mapping[str, str] = os.environ) -> dict[str, str]:
    """The environment as the user gave it, for a program of the user's own.

    Args:
        safe: An environment, possibly from `safe_environment`.
    """
    given = dict(safe)
    if given.get(SAFE) == OURS:
        del given[SAFE]
    if GIVEN in given:
        given[PATHS] = given.pop(GIVEN)
    return given


def make_safe() -> None:
    """Makes the environment of this process safe, for all processes that it starts."""
    safe = safe_environment()
    os.environ.pop(PATHS, None)
    os.environ.update(safe)
