"""Folders that nobody else can have written to: what is executed may lie there."""

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

# A full disk would be found out when a kernel has been compiled, by an error.
LEAST_FREE = 100_000_000


def user_cache() -> Path | None:
    """The user's folder for what can be made again; None for a user without a home."""
    return _user_folder("XDG_CACHE_HOME", ".cache")


def user_state() -> Path | None:
    """The user's folder for what lasts, and is neither data nor a setting."""
    return _user_folder("XDG_STATE_HOME", ".local/state")


def _user_folder(variable: str, below_home: str) -> Path | None:
    named = os.environ.get(variable, "")
    if os.path.isabs(named):
        return Path(named)
    with contextlib.suppress(RuntimeError):
        return Path.home() / below_home
    return None


def is_usable(folder: Path, mode: int = 0o700) -> bool:
    """Whether code may be kept there and believed later.

    Makes the folder if need be. It must be private and writable, with some room left
    on the disk.
    """
    try:
        folder.mkdir(mode, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            room = os.statvfs(folder)
    except OSError:
        return False
    return room.f_bavail * room.f_frsize >= LEAST_FREE and is_private(folder)


def is_private(folder: Path) -> bool:
    """Whether only this user and the superuser can have written there.

    True where the folder, those above it and all that is in it belong to one of the
    two, nobody else may write there (folders above may be sticky), and nothing in it
    is a link.
    """
    try:
        # A folder above may be a link that the owner of its parent has made.
        parents = [*folder.parent.absolute().parents, folder.parent]
        above = {*parents, *folder.parent.resolve(strict=True).parents}
        above.add(folder.parent.resolve())
        return all(_is_ours(p.stat(), sticky=True) for p in above) and all(
            _is_ours(status) for status in _inside(folder)
        )
    except OSError:
        return False


def copy(source: Path, target: Path) -> None:
    """Copies a folder, to be read by this user alone: whole, or not at all."""
    with contextlib.suppress(OSError):
        target.parent.mkdir(0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent) as aside:
            made = Path(shutil.copytree(source, Path(aside, target.name)))
            for path in (made, *made.rglob("*")):
                path.chmod(0o700 if path.is_dir() else 0o600)
            made.rename(target)


def _inside(folder: Path) -> Iterator[os.stat_result]:
    """Of the folder and everything in it, links not followed."""
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
    """Whether a group is the user's own, of which nobody else is a member."""
    with contextlib.suppress(KeyError):
        user, known = pwd.getpwuid(os.geteuid()), grp.getgrgid(group)
        alone = not set(known.gr_mem) - {user.pw_name}
        return user.pw_gid == group and known.gr_name == user.pw_name and alone
    return False
