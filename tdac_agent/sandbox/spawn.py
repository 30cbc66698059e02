"""Start the program of one child in the chosen tier."""

from __future__ import annotations

import contextlib
import fcntl
import os
import subprocess
import sys
from dataclasses import dataclass
from signal import SIGKILL

from tdac_agent.sandbox.bubblewrap import bubblewrap_command
from tdac_agent.sandbox.channel import Channel
from tdac_agent.sandbox.exposure import INNER, exposure
from tdac_agent.sandbox.folder import PrivateFolder
from tdac_agent.sandbox.limits import Limits

BOOT = (
    "import sys; *fds, code, site = sys.argv[1:]; "
    "sys.path[:] = [code, *sys.path, site]; from inner.main import main; "
    "main(*map(int, fds), site)"
)
# No `-I`: it would ignore PYTHONHASHSEED. The environment below is all there is.
OPTIONS = ("-s", "-S", "-P", "-B", "-u", "-X", "utf8")


@dataclass(slots=True)
class Spawned:
    """A started child.

    Attributes:
        process: Its first process, leader of a process group of its own.
        channel: The way to talk with it.
        lifeline: When this descriptor closes, the kernel kills the process group.
    """

    process: subprocess.Popen[bytes]
    channel: Channel
    lifeline: int


def spawn(tier: str, folder: PrivateFolder, limits: Limits) -> Spawned:
    """Start a child that waits for its setup frame.

    Raises:
        SandboxError: The tier cannot be used.
        OSError: The program cannot be started.
    """
    with contextlib.ExitStack() as theirs, contextlib.ExitStack() as ours:
        inner, outer = [], []
        for we_write in (True, False, False, True):
            ends = os.pipe()
            mine, other = ends[::-1] if we_write else ends
            ours.callback(os.close, mine)
            theirs.callback(os.close, other)
            outer.append(mine)
            inner.append(other)
        requests, answers, output, lifeline = inner
        command = [exposure().interpreter, *OPTIONS, "-c", BOOT]
        command += [str(end) for end in (requests, answers, lifeline)]
        command += [str(INNER.parent), str(folder.site)]
        if tier == "bubblewrap":
            size = limits.scratch_bytes
            command = bubblewrap_command(folder, lifeline, size) + command
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            pass_fds=(requests, answers, lifeline),
            start_new_session=True,
            cwd="/",
            env=_environment(folder),
        )
        _tie(lifeline, process.pid)
        ours.pop_all()
    write, read, printed, line = outer
    frame, most = limits.frame_bytes, limits.output_bytes
    return Spawned(process, Channel(write, read, printed, frame, most), line)


def _environment(folder: PrivateFolder) -> dict[str, str]:
    """Return the whole environment of the child: nothing of ours but library paths."""
    scratch = str(folder.scratch)
    environment = {
        "HOME": scratch,
        "TMPDIR": scratch,
        "LANG": "C.UTF-8",
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "PYTHONHASHSEED": "0",
    }
    if "LD_LIBRARY_PATH" in os.environ:
        environment["LD_LIBRARY_PATH"] = os.environ["LD_LIBRARY_PATH"]
    return environment


def _tie(lifeline: int, group: int) -> None:
    """Have the kernel kill `group` when our end of the lifeline closes.

    Unlike the parent-death signal this holds for the process and not for the thread
    that started the child.
    """
    if sys.platform == "linux":
        fcntl.fcntl(lifeline, fcntl.F_SETOWN, -group)
        fcntl.fcntl(lifeline, fcntl.F_SETSIG, SIGKILL)
        flags = fcntl.fcntl(lifeline, fcntl.F_GETFL)
        fcntl.fcntl(lifeline, fcntl.F_SETFL, flags | os.O_ASYNC)
