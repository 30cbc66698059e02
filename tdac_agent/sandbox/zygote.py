"""Zygotes: processes with numpy loaded that fork children, each for one use.

Starting an interpreter and loading numpy takes a tenth of a second, a fork a few
milliseconds. No controller code runs in a zygote, so its children share nothing that
one of them could have written.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import functools
import multiprocessing
import os
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tdac_agent.sandbox.bubblewrap import bubblewrap_command
from tdac_agent.sandbox.channel import Channel
from tdac_agent.sandbox.counters import shared_counters
from tdac_agent.sandbox.errors import SandboxError
from tdac_agent.sandbox.exposure import INNER, exposure, numpy_folders
from tdac_agent.sandbox.folder import PrivateFolder
from tdac_agent.sandbox.inner import landlock
from tdac_agent.sandbox.inner.zygote import FORK, REAP, REPLY, REQUEST
from tdac_agent.sandbox.limits import Limits
from tdac_agent.sandbox.waiting import RunQueue

BOOT = (
    "import sys; *fds, code, site = sys.argv[1:]; "
    "sys.path[:] = [code, *sys.path, site]; from inner.zygote import main; "
    "main(*map(int, fds), site)"
)
# Not `-I`: it ignores PYTHONHASHSEED. `_environment` is the whole environment.
OPTIONS = ("-s", "-S", "-P", "-B", "-u", "-X", "utf8")
SLOTS = 16
KEPT_OUTPUT = 4000
REAP_SECONDS = 10.0
# Indices of the counters: folders handed out so far, and living children.
GIVEN, ALIVE = 0, 1

Reaped = tuple[int, float, int]


@dataclass(slots=True)
class Forked:
    """A newly forked child.

    Attributes:
        pid: Its process ID as seen by the judge, also the ID of its process group.
        folder: Its private folder.
        channel: Channel to it.
        line: Run-queue statistics of its controller's process.
        lifeline: When this descriptor closes, the kernel kills the process group.
        reap: Waits for its end; returns exit code or minus the signal, CPU time, s,
            and peak resident bytes.
    """

    pid: int
    folder: PrivateFolder
    channel: Channel
    line: RunQueue
    lifeline: int
    reap: Callable[[], Reaped]


class NoRoomError(Exception):
    """The zygote has no free folder for another child."""


class Zygote:
    """Forks one child for each of its folders; ends with the last child.

    Where the kernel cannot separate the files of its children, it has only one child.
    Forks of the process that made the zygote may use it too, and share its folders;
    only the process that made it ends it.

    Args:
        tier: Name of the tier.
        limits: Limits of the scratch folders.
        slots: Maximum number of children.
        installed: Folders of installed packages that its children may import.

    Raises:
        SandboxError: The tier cannot be used.
        OSError: The program cannot be started.
    """

    def __init__(
        self,
        tier: str,
        limits: Limits,
        slots: int = SLOTS,
        installed: tuple[str, ...] = (),
    ) -> None:
        self.tier, self.installed = tier, installed
        self.scratch_bytes = limits.scratch_bytes
        separate = tier == "namespaces" or landlock.is_offered()
        slots = slots if separate and tier != "rlimits" else 1
        context = multiprocessing.get_context("fork")
        self._lock = context.Lock()
        self._counts = shared_counters(2)
        self.parent = Path(tempfile.mkdtemp(prefix="tdac-child-")).resolve()
        self.site = self.parent / "site"
        # Children must not be able to read this file.
        self.witness = self.parent / "witness"
        try:
            self.site.mkdir()
            for target in numpy_folders():
                (self.site / os.path.basename(target)).symlink_to(target)
            self.witness.write_text("not for children\n")
            self._folders = [PrivateFolder(self.parent) for _ in range(slots)]
            self._process, self._link, self._output, lifeline = self._start()
        except BaseException:
            shutil.rmtree(self.parent, ignore_errors=True)
            raise
        ends = (self._process, self._link, self._output, lifeline, self.parent)
        self._end = weakref.finalize(self, _end, os.getpid(), *ends)

    @property
    def slots(self) -> int:
        """Number of further children that it can have."""
        return len(self._folders) - self._counts[GIVEN]

    def fork(self, limits: Limits) -> Forked:
        """Return a new child, which waits for its setup frame.

        Raises:
            SandboxError: The zygote did not start, has ended, or cannot fork.
            NoRoomError: No folder is left.
        """
        with self._lock, contextlib.ExitStack() as theirs, contextlib.ExitStack() as us:
            if not self.slots:
                raise NoRoomError
            inner, outer = _pipes(theirs, us)
            message = [REQUEST.pack(FORK, 0)]
            self._link.settimeout(limits.start_seconds)
            try:
                socket.send_fds(self._link, message, inner)
                (number, _, reason), pid = self._answer()
            except OSError as error:
                raise SandboxError(f"{self.tier}: {self._last_words(error)}") from None
            if number < 0:
                text = os.strerror(reason)
                raise SandboxError(f"{self.tier}: cannot fork a child: {text}")
            _tie(inner[3], pid)
            us.pop_all()
            folder = self._folders[self._counts[GIVEN]]
            self._counts[GIVEN] += 1
            self._counts[ALIVE] += 1
        write, read, printed, lifeline = outer
        sizes = limits.frame_bytes, limits.output_bytes
        channel = Channel(write, read, printed, *sizes)
        reap = functools.partial(self._reap, number)
        return Forked(pid, folder, channel, RunQueue(pid), lifeline, reap)

    @property
    def ended(self) -> bool:
        """Whether it has ended, as far as this process knows."""
        return not self._end.alive

    def close(self) -> None:
        """Fork no further children; end now or with the last one."""
        with self._lock:
            self._counts[GIVEN] = len(self._folders)
            if not self._counts[ALIVE]:
                self._end()

    def kill(self) -> None:
        """End now, with all children; no process may use it afterwards."""
        self._end()

    def _reap(self, number: int) -> Reaped:
        """Wait for a killed child, whose process ID stays reserved until then."""
        lost = -signal.SIGKILL, 0.0, 0
        with self._lock:
            try:
                self._link.settimeout(REAP_SECONDS)
                self._link.send(REQUEST.pack(REAP, number))
                (status, cpu, peak), _ = self._answer()
                reaped = status, cpu, peak * (1 if sys.platform == "darwin" else 1024)
            except OSError:
                reaped = lost
            self._counts[ALIVE] -= 1
            if not self._counts[ALIVE] and not self.slots:
                self._end()
        return reaped

    def _answer(self) -> tuple[tuple[int, float, int], int]:
        """Return a reply, and the process ID of its sender in our namespace."""
        size = socket.CMSG_SPACE(struct.calcsize("3i"))
        data, ancillary, _, _ = self._link.recvmsg(REPLY.size, size)
        if len(data) < REPLY.size:
            raise OSError(errno.EPIPE, "the sandbox ended")
        reply = REPLY.unpack(data)
        for _, _, credentials in ancillary:
            return reply, struct.unpack("3i", credentials)[0]
        return reply, reply[0]

    def _last_words(self, error: OSError) -> str:
        """Kill the zygote; return what it printed, else the error."""
        self._process.kill()
        self._process.wait()
        with contextlib.suppress(BlockingIOError):
            printed = os.read(self._output, KEPT_OUTPUT).decode("utf-8", "replace")
            if printed.strip():
                return printed.strip()
        return str(error)

    def _start(self) -> tuple[subprocess.Popen[bytes], socket.socket, int, int]:
        """Return the process, our end of its socket, its output, and its lifeline."""
        with contextlib.ExitStack() as theirs, contextlib.ExitStack() as ours:
            link, control = socket.socketpair()
            ours.callback(link.close)
            theirs.callback(control.close)
            (printed, output), (line, lifeline) = os.pipe(), os.pipe()[::-1]
            for descriptor in (printed, line):
                ours.callback(os.close, descriptor)
            for descriptor in (output, lifeline):
                theirs.callback(os.close, descriptor)
            command = [exposure().interpreter, *OPTIONS, "-c", BOOT]
            command += [str(control.fileno()), str(lifeline)]
            command += [str(INNER.parent), str(self.site)]
            if self.tier == "bubblewrap":
                scratch = [str(folder.scratch) for folder in self._folders]
                wrapper = bubblewrap_command(
                    self.parent,
                    scratch,
                    lifeline,
                    self.scratch_bytes,
                    self.installed,
                )
                command = wrapper + command
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                pass_fds=(control.fileno(), lifeline),
                start_new_session=True,
                cwd="/",
                env=_environment(self.parent),
            )
            _tie(lifeline, process.pid)
            if sys.platform == "linux":
                # The kernel reports a child's ID as seen from our namespace.
                link.setsockopt(socket.SOL_SOCKET, socket.SO_PASSCRED, 1)
            os.set_blocking(printed, False)
            ours.pop_all()
        return process, link, printed, line


def _pipes(
    theirs: contextlib.ExitStack, ours: contextlib.ExitStack
) -> tuple[list[int], list[int]]:
    """Return the child's and our pipe ends: requests, answers, output, lifeline."""
    inner: list[int] = []
    outer: list[int] = []
    for we_write in (True, False, False, True):
        ends = os.pipe()
        mine, other = ends[::-1] if we_write else ends
        ours.callback(os.close, mine)
        theirs.callback(os.close, other)
        outer.append(mine)
        inner.append(other)
    return inner, outer


def _end(
    owner: int,
    process: subprocess.Popen[bytes],
    link: socket.socket,
    output: int,
    lifeline: int,
    parent: Path,
) -> None:
    """Kill a zygote and its remaining children; only its owner process does this."""
    if os.getpid() != owner:
        return
    link.close()
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    os.close(output)
    os.close(lifeline)
    shutil.rmtree(parent, ignore_errors=True)


def _environment(folder: Path) -> dict[str, str]:
    """Return a zygote's whole environment; only the library path comes from ours."""
    environment = {
        "HOME": str(folder),
        "TMPDIR": str(folder),
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

    Unlike the parent-death signal, this depends on our process and not on the thread
    that started the child.
    """
    if sys.platform == "linux":
        fcntl.fcntl(lifeline, fcntl.F_SETOWN, -group)
        fcntl.fcntl(lifeline, fcntl.F_SETSIG, signal.SIGKILL)
        flags = fcntl.fcntl(lifeline, fcntl.F_GETFL)
        fcntl.fcntl(lifeline, fcntl.F_SETFL, flags | os.O_ASYNC)
