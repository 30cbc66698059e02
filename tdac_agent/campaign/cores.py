"""A core for each worker of a machine, and one verification at a time on it.

The locks are the system's: whoever dies, has let go. Workers of all campaigns on a
machine share them; where there are more workers than cores, which is sensible as long
as they wait for models, several share a core and verify one after the other. So a
verdict is never the result of a crowd.
"""

from __future__ import annotations

import fcntl
import os
import random
import tempfile
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from tdac_agent.errors import Fault
from tdac_agent.storage.locks import open_lock


@contextmanager
def own_core() -> Generator[Path]:
    """Moves this process, and all that it starts, to a core; the least crowded one.

    Yields:
        A file whose lock is to be held while something is verified there.

    Raises:
        Fault: There is no place for the locks.
    """
    folder = core_locks()
    before = os.sched_getaffinity(0)
    with ExitStack() as stack:
        core = _take(folder, sorted(before), stack)
        os.sched_setaffinity(0, {core})
        stack.callback(os.sched_setaffinity, 0, before)
        yield folder / f"{core}.turn"


def core_locks() -> Path:
    """The folder of the locks, which nobody else can read or write.

    Raises:
        Fault: What has its name is somebody else's.
    """
    places = [Path(tempfile.gettempdir()) / f"tdac-cores-{os.geteuid()}"]
    if os.environ.get("XDG_RUNTIME_DIR"):
        places.append(Path(os.environ["XDG_RUNTIME_DIR"]) / "tdac-cores")
    for place in places:
        if _is_private(place):
            return place
    raise Fault(
        f"no place for the locks of the cores: {places[0]} is not a folder of your own "
        "that can be written to; remove it, or set TMPDIR to another folder"
    )


def _is_private(folder: Path) -> bool:
    """Whether this is a folder of this user, not by a link; makes it, and closes it."""
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


def _take(folder: Path, cores: list[int], stack: ExitStack) -> int:
    """The first core that nobody has; one by chance where all are taken."""
    for core in cores:
        handle = open_lock(folder / f"{core}.taken")
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(handle)
            continue
        stack.callback(os.close, handle)
        return core
    return random.choice(cores)
