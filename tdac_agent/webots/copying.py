"""Copies what a Webots controller needs of its project, and nothing else.

A project may come from anybody, and its folder may be somebody's home. Links that lead
out of the copied folders, and anything but files and folders, are left out; the size,
the number of files and the depth are bounded.
"""

from __future__ import annotations

import os
import shutil
import stat
from dataclasses import dataclass, field
from pathlib import Path

from tdac_agent.storage.plain import printable

LARGEST = 64 << 20
"""Maximum size of all copied files together, bytes."""
MOST_FILES = 10_000
"""Maximum number of files and folders."""
DEEPEST = 20
MOST_NOTES = 10
_HIDDEN = ("__pycache__",)


class NoSpaceError(Exception):
    """A folder is larger than what may still be copied."""


@dataclass(slots=True)
class Copier:
    """Copies parts of a project.

    Attributes:
        root: Folder of the project, without links; notes name files relative to it.
        within: Folders in it; nothing outside of them is copied.
        room: How many more bytes may be copied.
        files: How many more files may be copied.
        notes: What was left out, and why.
    """

    root: Path
    within: tuple[Path, ...]
    room: int = LARGEST
    files: int = MOST_FILES
    notes: list[str] = field(default_factory=list)

    def file(self, source: Path, target: Path) -> None:
        """Copies one file.

        Raises:
            NoSpaceError: The file does not fit.
        """
        real = self._inside(source)
        if real is None:
            return
        try:
            status = os.stat(real)
            if not stat.S_ISREG(status.st_mode):
                return
            self._take(status.st_size)
            shutil.copyfile(real, target)
        except OSError as error:
            self._note(source, f"cannot be read: {error.strerror}")

    def folder(self, source: Path, target: Path, *, suffix: str = "") -> bool:
        """Copies a folder with all folders in it, or nothing; returns whether it did.

        Args:
            source: The folder.
            target: Where to copy it; must not exist.
            suffix: End of the names of the files to copy; by default all are.
        """
        before = self.room, self.files
        try:
            self._tree(source, target, suffix, ())
        except NoSpaceError:
            self.room, self.files = before
            shutil.rmtree(target, ignore_errors=True)
            size = f"more than {LARGEST >> 20} MB or {MOST_FILES} files in all"
            self._note(source, size)
            return False
        return target.is_dir()

    def _tree(
        self, source: Path, target: Path, suffix: str, above: tuple[Path, ...]
    ) -> None:
        real = self._inside(source)
        if real is None or real in above:  # a link to a folder above copies nothing
            return
        if len(above) > DEEPEST:
            self._note(source, f"more than {DEEPEST} folders deep")
            return
        self._take(0)
        target.mkdir()
        try:
            entries = sorted(os.scandir(real), key=lambda entry: entry.name)
        except OSError as error:
            self._note(source, f"cannot be read: {error.strerror}")
            return
        for entry in entries:
            if entry.name in _HIDDEN or entry.name.startswith("."):
                continue
            inner = real / entry.name
            if inner.is_dir():
                self._tree(inner, target / entry.name, suffix, (*above, real))
            elif entry.name.endswith(suffix):
                self.file(inner, target / entry.name)

    def _inside(self, path: Path) -> Path | None:
        """The path without links; None, and a note, if it leads elsewhere."""
        try:
            real = path.resolve(strict=True)
        except (OSError, RuntimeError):
            return None  # a link to nothing, or to itself
        if any(real.is_relative_to(folder) for folder in self.within):
            return real
        self._note(path, "a link that leads out of the copied folders")
        return None

    def _take(self, size: int) -> None:
        self.room -= size
        self.files -= 1
        if self.room < 0 or self.files < 0:
            raise NoSpaceError

    def _note(self, path: Path, why: str) -> None:
        if len(self.notes) == MOST_NOTES:
            self.notes.append("further files are not copied to the controller")
        if len(self.notes) < MOST_NOTES:
            name = printable(str(path.relative_to(self.root)))
            self.notes.append(f"{name} is not copied to the controller: {why}")
