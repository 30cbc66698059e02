"""Binds each worker to a core, and allows one verification at a time per core.

The locks are file locks, which the OS releases when a process dies; workers of all
campaigns on a machine share them. With more workers than cores, which is useful while
workers wait for models, several share a core and verify one after another, so that
contention does not affect verdicts.
"""

from __future__ import annotations

import os
import random
import tempfile
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from tdac_agent.errors import Fault
from tdac_agent.storage.locks import first_free


@contextmanager
def own_core() -> Generator[Path]:
    """Binds this process and its children to a free core, or else to a random one.

    Yields:
        Lock file to hold during a verification on this core.

    Raises:
        Fault: There is no private folder for the locks.
    """
    folder = core_locks()
    before = os.sched_getaffinity(0)
    with ExitStack() as stack:
        cores = sorted(before)
        free = first_free(folder / f"{core}.taken" for core in cores)
        core = random.choice(cores) if free is None else cores[free[0]]
        if free is not None:
            stack.callback(os.close, free[1])
        os.sched_setaffinity(0, {core})
        stack.callback(os.sched_setaffinity, 0, before)
        yield folder / f"{core}.turn"


def core_locks() -> Path:
    """The folder of the core locks, which is accessible to this user only.

    Raises:
        Fault: No candidate is a writable folder of this user.
    """
    places = [Path(tempfile.gettempdir()) / f"tdac-cores-{os.geteuid()}"]
    if os.environ.get("XDG_RUNTIME_DIR"):
        places.append(Path(os.environ["XDG_RUNTIME_DIR"]) / "tdac-cores")
    for place in places:
        if _is_private(place):
            return place
    raise Fault(
        f"no folder for the core locks: {places[0]} is not a writable folder of your "
        "own; remove it, or set TMPDIR to another folder"
    )


def _is_private(folder: Path) -> bool:
    """Makes a folder with mode 0700; False unless owned, writable and no symlink."""
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError:
        return False
    try:
        if os.fstat(handle).st_uid != os.geteuid():
            return False
        os.fchmod(handle, 0o700)
        return os.access(folder, os.W_OK)
    finally:
        os.close(handle)
