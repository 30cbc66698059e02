"""The command line of bubblewrap for one zygote."""

from __future__ import annotations

import shutil
from pathlib import Path

from tdac_agent.sandbox.errors import SandboxError
from tdac_agent.sandbox.exposure import exposure


def bubblewrap_command(
    parent: Path,
    scratch: list[str],
    lifeline: int,
    scratch_bytes: int,
    installed: tuple[str, ...] = (),
) -> list[str]:
    """Return the arguments that come before the zygote's own command.

    Args:
        parent: Folder that contains the private folders.
        scratch: Scratch folders in the private folders.
        lifeline: Descriptor that bubblewrap's first process keeps open, out of the
            controllers' reach.
        scratch_bytes: Size limit of each scratch folder.
        installed: Folders of installed packages that controllers may import.

    Raises:
        SandboxError: bubblewrap is not installed.
    """
    program = shutil.which("bwrap")
    if program is None:
        raise SandboxError("bubblewrap (bwrap) is not installed")
    words = [program, "--unshare-user", "--unshare-net", "--unshare-pid"]
    words += ["--unshare-ipc", "--unshare-uts", "--unshare-cgroup-try"]
    # Otherwise bubblewrap adds an init process that reaps ended children, and their
    # CPU time is lost.
    words += ["--as-pid-1"]
    words += ["--uid", "65534", "--gid", "65534", "--cap-drop", "ALL"]
    words += ["--sync-fd", str(lifeline)]
    seen = exposure()
    for path, target in seen.links:
        words += ["--symlink", target, path]
    words += _each("--ro-bind", seen.system)
    for path in seen.hidden:
        words += ["--tmpfs", path]
    # numpy may be in a hidden folder, which can become read-only only afterwards.
    words += _each("--ro-bind", (*installed, *seen.packages, str(parent)))
    for path in seen.hidden:
        words += ["--remount-ro", path]
    words += _each("--dev-bind", seen.devices)
    for path in scratch:
        words += ["--size", str(scratch_bytes), "--tmpfs", path]
    return [*words, "--remount-ro", "/", "--chdir", "/", "--"]


def _each(option: str, paths: tuple[str, ...]) -> list[str]:
    return [word for path in paths for word in (option, path, path)]
