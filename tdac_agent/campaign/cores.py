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


@contextmanager
def own_core() -> Generator[Path]:
    """Moves this process, and all that it starts, to a core; the least crowded one.

    Yields:
        A file whose lock is to be held while something is verified there.
    """
    folder = Path(tempfile.gettempdir()) / f"tdac-cores-{os.getuid()}"
    folder.mkdir(exist_ok=True)
    before = os.sched_getaffinity(0)
    with ExitStack() as stack:
        core = _take(folder, sorted(before), stack)
        os.sched_setaffinity(0, {core})
        stack.callback(os.sched_setaffinity, 0, before)
        yield folder / f"{core}.turn"


def _take(folder: Path, cores: list[int], stack: ExitStack) -> int:
    """The first core that nobody has; one by chance where all are taken."""
    for core in cores:
        handle = os.open(folder / f"{core}.taken", os.O_RDWR | os.O_CREAT, 0o644)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(handle)
            continue
        stack.callback(os.close, handle)
        return core
    return random.choice(cores)
