"""New user, mount, PID, network, IPC, host-name and cgroup namespaces.

Replaces bubblewrap on machines that do not have it.
"""

from __future__ import annotations

import ctypes
import os
import signal
import struct
from typing import Any

from . import kernel

_UNSHARE = (
    0x10000000  # user
    | 0x00020000  # mount
    | 0x20000000  # process
    | 0x40000000  # network
    | 0x08000000  # IPC
    | 0x04000000  # host name
    | 0x02000000  # cgroup
)
_NOSUID, _NODEV, _BIND, _RECURSIVE, _PRIVATE = 2, 4, 4096, 16384, 1 << 18
_NOBODY = 65534
_PID = struct.Struct("=i")


def enter(setup: dict[str, Any]) -> dict[str, int]:
    """Make new namespaces and fork; return only in their first process.

    The calling process waits for the inner one and ends with the same status.

    Returns:
        The ID of the inner process as seen from outside, with which the judge reads
        its CPU times in /proc.

    Raises:
        OSError: The kernel or the container does not allow it.
    """
    uid, gid = os.getuid(), os.getgid()
    kernel.unshare(_UNSHARE)
    _write("/proc/self/setgroups", "deny")
    _write("/proc/self/uid_map", f"{_NOBODY} {uid} 1")
    _write("/proc/self/gid_map", f"{_NOBODY} {gid} 1")
    kernel.mount("none", "/", "", _RECURSIVE | _PRIVATE)
    _build_root(setup)
    pid_read, pid_write = os.pipe()
    pid = os.fork()
    if pid:
        os.write(pid_write, _PID.pack(pid))
        _wait_and_exit(pid, [*setup["descriptors"], pid_read, pid_write])
    os.close(pid_write)
    (outer_pid,) = _PID.unpack(os.read(pid_read, _PID.size))
    os.close(pid_read)
    kernel.prctl(kernel.PR_SET_PDEATHSIG, signal.SIGKILL)
    kernel.prctl(kernel.PR_SET_NO_NEW_PRIVS, 1)
    header = struct.pack("=Ii", 0x20080522, 0)
    kernel.syscall("capset", _buffer(header), _buffer(bytes(24)))
    return {"pid": outer_pid}


def _write(path: str, text: str) -> None:
    with open(path, "w", encoding="ascii") as file:
        file.write(text)


def _buffer(data: bytes) -> ctypes.Array[ctypes.c_char]:
    return ctypes.create_string_buffer(data, len(data))


def _build_root(setup: dict[str, Any]) -> None:
    """Make a root folder with only the visible paths, and move into it."""
    scratch = setup["scratch"]
    # The scratch folder is the only place that is certainly free to mount over.
    kernel.mount("tmpfs", scratch, "tmpfs", _NOSUID | _NODEV, "mode=755")
    for path, target in setup["links"]:
        os.symlink(target, scratch + path)
    for path in setup["system"]:
        _show(path, scratch, _RECURSIVE)
    for path in setup["hidden"]:
        kernel.mount("tmpfs", scratch + path, "tmpfs", _NOSUID | _NODEV, "mode=755")
    for path in setup["packages"]:
        _show(path, scratch, _RECURSIVE)
    for path in (*setup["devices"], setup["root"], setup["site"]):
        _show(path, scratch, 0)
    _hide_parents(setup, scratch)
    _make_read_only(scratch)
    options = f"mode=700,size={setup['scratch_bytes']}"
    kernel.mount("tmpfs", scratch + scratch, "tmpfs", _NOSUID | _NODEV, options)
    os.chdir(scratch)
    kernel.syscall("pivot_root", _buffer(b".\0"), _buffer(b".\0"))
    kernel.detach(".")
    os.chdir("/")


def _show(path: str, root: str, recursive: int) -> None:
    target = root + path
    if os.path.isdir(path):
        os.makedirs(target, exist_ok=True)
    else:
        os.makedirs(os.path.dirname(target), exist_ok=True)
        os.close(os.open(target, os.O_CREAT | os.O_RDONLY))
    kernel.mount(path, target, "", _BIND | recursive)


def _hide_parents(setup: dict[str, Any], root: str) -> None:
    """Make the parent folders of visible paths impossible to list.

    Their entries show where this machine has its files, and differ from run to run.
    """
    shown = (*setup["system"], *setup["packages"], setup["root"], setup["site"])
    device = os.stat(root).st_dev
    parents = {path[:n] for path in shown for n, c in enumerate(path) if c == os.sep}
    for parent in parents:
        if os.stat(root + parent).st_dev == device:
            os.chmod(root + parent, 0o111)


def _make_read_only(root: str) -> None:
    """Make every mount below `root` read-only, without set-uid programs."""
    attributes = struct.pack("=4Q", 1 | 2, 0, 0, 0)
    at_cwd, recursive = -100, 0x8000
    path = _buffer(os.fsencode(root) + b"\0")
    kernel.syscall("mount_setattr", at_cwd, path, recursive, _buffer(attributes), 32)


def _wait_and_exit(pid: int, descriptors: list[int]) -> None:
    """Wait for the inner process and end as it did."""
    for descriptor in descriptors:
        os.close(descriptor)
    _, status = os.waitpid(pid, 0)
    code = os.waitstatus_to_exitcode(status)
    if code < 0:
        if code != -signal.SIGKILL:
            signal.signal(-code, signal.SIG_DFL)
            signal.pthread_sigmask(signal.SIG_UNBLOCK, [-code])
        os.kill(os.getpid(), -code)
    os._exit(code)
