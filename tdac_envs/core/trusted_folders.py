"""Folders that no other user can write to, so that code in them can be trusted."""

from __future__ import annotations

import contextlib
import grp
import os
import pwd
import shutil
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

# Bytes. On a full disk, numba fails only after compiling a kernel.
LEAST_FREE = 100_000_000


def user_cache() -> Path | None:
    """The user's cache folder; None for a user without a home."""
    return _user_folder("XDG_CACHE_HOME", ".cache")


def user_state() -> Path | None:
    """The user's folder for persistent state; None for a user without a home."""
    return _user_folder("XDG_STATE_HOME", ".local/state")


def _user_folder(variable: str, below_home: str) -> Path | None:
    named = os.environ.get(variable, "")
    if os.path.isabs(named):
        return Path(named)
    with contextlib.suppress(RuntimeError):
        return Path.home() / below_home
    return None


def is_usable(folder: Path, mode: int = 0o700) -> bool:
    """Whether code can be stored in the folder and trusted later.

    Creates the folder if needed. It must be private and writable, with at least
    `LEAST_FREE` bytes free on the disk.
    """
    try:
        folder.mkdir(mode, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            disk = os.statvfs(folder)
    except OSError:
        return False
    return disk.f_bavail * disk.f_frsize >= LEAST_FREE and is_private(folder)


def is_private(folder: Path) -> bool:
    """Whether only this user and the superuser can have written to the folder.

    True if the folder, its parents and its contents belong to one of the two, nobody
    else may write to them (parents may be sticky), and nothing in it is a link.
    """
    try:
        # A parent may be a link: both its own parents and its target's are checked.
        parents = [*folder.parent.absolute().parents, folder.parent]
        above = {*parents, *folder.parent.resolve(strict=True).parents}
        above.add(folder.parent.resolve())
        return all(_is_ours(p.stat(), sticky=True) for p in above) and all(
            _is_ours(status) for status in _inside(folder)
        )
    except OSError:
        return False


def copy(source: Path, target: Path) -> None:
    """Copies a folder completely or not at all; only this user can read the copy."""
    with contextlib.suppress(OSError):
        target.parent.mkdir(0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent) as aside:
            made = Path(shutil.copytree(source, Path(aside, target.name)))
            for path in (made, *made.rglob("*")):
                path.chmod(0o700 if path.is_dir() else 0o600)
            made.rename(target)


def _inside(folder: Path) -> Iterator[os.stat_result]:
    """Status of the folder and of everything in it; links are not followed."""
    yield folder.lstat()
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_dir(follow_symlinks=False):
                yield from _inside(Path(entry.path))
            else:
                yield entry.stat(follow_symlinks=False)


def _is_ours(status: os.stat_result, *, sticky: bool = False) -> bool:
    if status.st_uid not in (0, os.geteuid()) or stat.S_ISLNK(status.st_mode):
        return False
    if sticky and status.st_mode & stat.S_ISVTX:
        return True
    if status.st_mode & stat.S_IWOTH:
        return False
    return not status.st_mode & stat.S_IWGRP or _has_no_others(status.st_gid)


def _has_no_others(group: int) -> bool:
    """Whether a group is the user's own and has no other members."""
    with contextlib.suppress(KeyError):
        user, known = pwd.getpwuid(os.geteuid()), grp.getgrgid(group)
        alone = not set(known.gr_mem) - {user.pw_name}
        return user.pw_gid == group and known.gr_name == user.pw_name and alone
    return False
