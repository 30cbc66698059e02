"""A process with numpy loaded that forks one child after another.

No controller code runs in it: a child reads its first request only after the fork.
"""

from __future__ import annotations

import gc
import importlib
import os
import signal
import socket
import struct
import sys
import traceback
from typing import NoReturn

from . import kernel
from .main import main as serve

# Command, and for REAP the process ID of the child.
REQUEST = struct.Struct("<cI")
FORK, REAP = b"F", b"R"
# Reply to FORK: the child sends its process ID in this namespace, or the zygote sends
# -1 and an error number. To REAP: exit code or minus the signal number, CPU seconds,
# `ru_maxrss`.
REPLY = struct.Struct("<qdq")
DESCRIPTORS = 4
# Common imports of controllers and `sensors.py`, loaded once and not in each child.
LIKELY = (
    "bisect",
    "dataclasses",
    "heapq",
    "itertools",
    "json",
    "math",
    "numpy.typing",
    "pathlib",
    "random",
    "re",
    "time",
    "typing",
    "zlib",
)


def main(control: int, lifeline: int, site: str) -> None:
    """Serve the judge on a socket until the judge closes it.

    Args:
        control: Descriptor of the socket.
        lifeline: Descriptor that children do not need.
        site: Folder from which numpy is imported.
    """
    if os.getpid() == 1:
        # Die with bubblewrap, since the lifeline's signal does not reach PID 1.
        kernel.prctl(kernel.PR_SET_PDEATHSIG, signal.SIGKILL)
    for name in LIKELY:
        importlib.import_module(name)
    # The memory of all objects made so far stays shared with the children.
    gc.collect()
    gc.freeze()
    link = socket.socket(fileno=control)
    while True:
        data, descriptors, _, _ = socket.recv_fds(link, REQUEST.size, DESCRIPTORS)
        if not data:
            os._exit(0)
        command, pid = REQUEST.unpack(data)
        if command == REAP:
            link.send(_reap(pid))
            continue
        try:
            forked = os.fork()
        except OSError as error:
            link.send(REPLY.pack(-1, 0.0, error.errno or 0))
        else:
            if forked == 0:
                os.close(lifeline)
                _be_child(link, descriptors, site)
        for descriptor in descriptors:
            os.close(descriptor)


def _reap(pid: int) -> bytes:
    """Wait for a child to end; return its reply to REAP."""
    _, status, used = os.wait4(pid, 0)
    cpu = used.ru_utime + used.ru_stime
    return REPLY.pack(os.waitstatus_to_exitcode(status), cpu, used.ru_maxrss)


def _be_child(link: socket.socket, descriptors: list[int], site: str) -> NoReturn:
    """Lead a new session and process group, and serve the judge."""
    try:
        requests, answers, output, lifeline = descriptors
        os.setsid()
        os.dup2(output, 1)
        os.dup2(output, 2)
        os.close(output)
        link.send(REPLY.pack(os.getpid(), 0.0, 0))
        link.close()
        serve(requests, answers, lifeline, site)
    except SystemExit as error:
        print(error, file=sys.stderr)
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(1)
