"""Permissions for folders and files that this installation did not create.

Run folders, tasks and campaigns are data. A part of them that runs outside the sandbox,
spends money or sends data elsewhere is used only if this installation created the
folder, or if the user gives the same flag or `--trust`.
"""

from __future__ import annotations

import itertools
import json
import shlex
import shutil
import sys
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tdac_agent.storage.hashes import sha256_of, sha256_of_file
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.task_file import OWN_SUITE
from tdac_envs.core.errors import TdacError

MOST_FILES, MOST_BYTES = 2000, 64 << 20
"""Limits of a suite."""
LONGEST_LINE = 2000
SHORT = 12
"""Number of printed digits of a hash."""


class NotTrustedError(TdacError):
    """A file needs permissions that the user has not given; one line for each."""

    def __init__(self, lines: Iterable[str]) -> None:
        self.lines = tuple(lines)
        super().__init__("; ".join(self.lines))

    def __reduce__(self) -> Any:
        return type(self), (self.lines,)


@dataclass(frozen=True, slots=True)
class Wish:
    """A permission that a folder or a file needs.

    Attributes:
        what: Description, such as `run the tests in DIR`.
        flag: Command-line words that give it; if empty, only `--trust` does.
        sha256: Hash of the files that would run, or an empty string.
    """

    what: str
    flag: tuple[str, ...] = ()
    sha256: str = ""

    def __str__(self) -> str:
        return (
            f"{self.what} (sha256 {self.sha256[:SHORT]})" if self.sha256 else self.what
        )


def permit(whose: str | Path, wishes: Iterable[Wish], *, trust: bool) -> None:
    """Prints the permissions that `--trust` gives, or refuses.

    Args:
        whose: Folder or file.
        wishes: Permissions that it needs and that no flag gives.
        trust: Whether the user gave `--trust`.

    Raises:
        NotTrustedError: It needs permissions, and `trust` is false.
    """
    needed = list(wishes)
    if needed and not trust:
        start = f"{whose} was not created by this installation and wants to"
        raise NotTrustedError(
            _line(f"{start} {wish}: {_how_to_allow(wish)}") for wish in needed
        )
    for wish in needed:
        line = _line(f"trusted for this command only: {whose} may {wish}")
        print(line, file=sys.stderr)


def _line(text: str) -> str:
    """Makes text from an untrusted file safe to print."""
    from tdac_agent.storage.secrets import one_line  # rarely needed, slow to import

    return one_line(text, LONGEST_LINE)


def _how_to_allow(wish: Wish) -> str:
    flag = f"{shlex.join(wish.flag)}, or with " if wish.flag else ""
    return f"allow it with {flag}--trust"


def allowed(task: Task, suite: Path | None, *, trust: bool) -> Task:
    """Returns the task with tests that the user gave or trusts.

    Args:
        task: The task as its file states it.
        suite: Folder of the flag `--suite`; replaces the task's own tests.
        trust: Whether the user gave `--trust`.

    Raises:
        NotTrustedError: The task brings tests that are not permitted.
    """
    if suite is not None:
        return replace(task, suite=suite, trusted=True)
    if task.suite is not None and not task.trusted:
        permit(task.folder or task.name, [suite_wish(task.suite)], trust=trust)
    return replace(task, trusted=True)


def keep_suite(suite: Path, folder: Path) -> None:
    """Copies the user's own tests to a run folder."""
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(suite, folder / OWN_SUITE, ignore=ignored, dirs_exist_ok=True)


def suite_wish(suite: Path) -> Wish:
    """Returns the permission to run a folder's tests outside the sandbox."""
    digest = tree_sha256(suite)
    return Wish(f"run the tests in {suite}", ("--suite", str(suite)), digest or "")


def asking(role: str, name: str) -> str:
    """Describes the use of a model as a wish."""
    kind, _, words = name.partition(":")
    if kind == "command":
        return f"run the program `{words}` as its {role}"
    return f"ask {name} as its {role}"


def tree_sha256(folder: Path) -> str | None:
    """Returns the hash of all files below a folder, except byte code, which never runs.

    Returns None if the folder contains links, special files or too much data.
    """
    paths = list(itertools.islice(folder.rglob("*"), MOST_FILES + 1))
    if len(paths) > MOST_FILES:
        return None
    hashes: dict[str, str] = {}
    size = 0
    for path in sorted(paths):
        inside = path.relative_to(folder)
        if "__pycache__" in inside.parts:
            continue
        if path.is_symlink() or not (path.is_dir() or path.is_file()):
            return None
        if path.is_file():
            size += path.stat().st_size
            if size > MOST_BYTES:
                return None
            hashes[str(inside)] = sha256_of_file(path)
    return sha256_of(json.dumps(hashes))
