"""What a folder or a file of somebody else's may not do by itself: run, or reach out.

A run folder, a task, a campaign is data. What of it runs on this machine outside the
sandbox, spends money or is sent something is used only where this installation began
the folder, where the same flag is given, or with `--trust`.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import shlex
import sys
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from tdac_agent.tasks.task import Task
from tdac_envs.core.errors import TdacError
from tdac_envs.core.intake import RECORD_BYTES, read_file

MOST_FILES, MOST_BYTES = 2000, 64 << 20
"""Of a suite."""
LONGEST_LINE = 2000
SHORT = 12
"""Digits of a hash that are shown."""


class NotTrustedError(TdacError):
    """Somebody else's file wants what only the user may allow; a line for each."""

    def __init__(self, lines: Iterable[str]) -> None:
        self.lines = tuple(lines)
        super().__init__("; ".join(self.lines))


@dataclass(frozen=True, slots=True)
class Wish:
    """One thing that a folder or a file wants.

    Attributes:
        what: In words, as in `run the tests in DIR`.
        flag: Words of the command line that allow it; none but `--trust` where empty.
        sha256: Of the files that would run.
    """

    what: str
    flag: tuple[str, ...] = ()
    sha256: str = ""

    def __str__(self) -> str:
        return (
            f"{self.what} (sha256 {self.sha256[:SHORT]})" if self.sha256 else self.what
        )


def permit(whose: str | Path, wishes: Iterable[Wish], *, trust: bool) -> None:
    """Lists what is allowed by `--trust`, or refuses.

    Args:
        whose: Folder or file.
        wishes: What it wants and was not given by a flag.
        trust: Whether the user trusts it, this time.

    Raises:
        NotTrustedError: With a line for each wish.
    """
    asked = list(wishes)
    if asked and not trust:
        raise NotTrustedError(
            _line(f"{whose}, which was not begun here, wants to {wish}: {_ways(wish)}")
            for wish in asked
        )
    for wish in asked:
        told = _line(f"trusted for this once: {whose} may {wish}")
        print(told, file=sys.stderr)


def _line(text: str) -> str:
    """Words of somebody else's, which may hold anything, to be shown."""
    from tdac_agent.storage.secrets import one_line  # seldom needed, slow to load

    return one_line(text, LONGEST_LINE)


def _ways(wish: Wish) -> str:
    given = f"{shlex.join(wish.flag)}, or with " if wish.flag else ""
    return f"allow it with {given}--trust"


def allowed(task: Task, suite: Path | None, *, trust: bool) -> Task:
    """A task with the tests that the user wants, or trusts.

    Args:
        task: As its file tells.
        suite: Folder of the flag `--suite`, in the place of the task's own tests.
        trust: Whether the user trusts the file, this time.

    Raises:
        NotTrustedError: It brings tests, and nothing allows them.
    """
    if suite is not None:
        return replace(task, suite=suite, trusted=True)
    if task.suite is not None and not task.trusted:
        permit(task.folder or task.name, [suite_wish(task.suite)], trust=trust)
    return replace(task, trusted=True)


def suite_wish(suite: Path) -> Wish:
    """To run the tests of a folder, which are not in the sandbox."""
    digest = tree_sha256(suite)
    return Wish(f"run the tests in {suite}", ("--suite", str(suite)), digest or "")


def asking(role: str, name: str) -> str:
    """What a model is wanted for, in words."""
    kind, _, words = name.partition(":")
    if kind == "command":
        return f"run the program `{words}` as its {role}"
    return f"ask {name} as its {role}"


def file_sha256(path: Path) -> str:
    """Hash of a file."""
    return hashlib.sha256(read_file(path, RECORD_BYTES)).hexdigest()


def tree_sha256(folder: Path) -> str | None:
    """Hash of all files below a folder, byte code left out; it is never used.

    None where there are links, things that are no files, or far too many.
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
            hashes[str(inside)] = file_sha256(path)
    return hashlib.sha256(json.dumps(hashes).encode()).hexdigest()
