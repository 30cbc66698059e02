"""Starts Python so that no module comes from the folder in which a process works.

That folder may be somebody else's. With `-m` and `-c`, Python looks there for modules
first, before its own library; with an empty or relative entry of PYTHONPATH, too.

Until `make_safe` has run, only modules are imported that Python has loaded by itself.
"""

import os
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Mapping

SAFE, PATHS = "PYTHONSAFEPATH", "PYTHONPATH"
OURS = "tdac"
"""Value of PYTHONSAFEPATH if it is ours: Python takes any that is not empty."""
GIVEN = "TDAC_GIVEN_PYTHONPATH"
"""Variable that keeps the user's PYTHONPATH."""


def python(*words: str) -> list[str]:
    """The command that starts this Python with some words."""
    return [sys.executable, "-P", *words]


def safe_environment(given: "Mapping[str, str]" = os.environ) -> dict[str, str]:
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


def given_environment(safe: "Mapping[str, str]" = os.environ) -> dict[str, str]:
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
    """Makes this process safe, and its environment for all processes that it starts."""
    _leave_out(os.environ.get(PATHS, ""))
    safe = safe_environment()
    os.environ.pop(PATHS, None)
    os.environ.update(safe)


def _leave_out(given: str) -> None:
    """Removes from the module path what relative entries of PYTHONPATH have added.

    Python has made them absolute. The folder of this package stays.
    """
    own = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    try:
        added = {
            os.path.abspath(path)
            for path in (given.split(os.pathsep) if given else ())
            if not os.path.isabs(path)
        }
    except OSError:  # there is no working directory any more
        return
    sys.path[:] = [path for path in sys.path if path == own or path not in added]
