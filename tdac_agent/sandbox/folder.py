"""The private folder of one child: working folder and scratch folder."""

from __future__ import annotations

import os
import secrets
import shutil
from pathlib import Path

from tdac_agent.sandbox.errors import SandboxError

WEIGHTS = "weights.npz"
"""Numbers of a learned controller."""
WEIGHTS_BYTES = 16 << 20
"""Size limit of this file, which each episode copies."""
MAX_FOLDER_BYTES = 256 << 20


class PrivateFolder:
    """A new folder with `work` and `scratch`, made for one child.

    Other children cannot guess its name.

    Args:
        parent: Folder in which it is made.

    Attributes:
        root: The folder.
        work: Working folder of the controller.
        scratch: Folder that the controller may write to.
    """

    def __init__(self, parent: Path) -> None:
        self.root = parent / secrets.token_hex(16)
        self.work = self.root / "work"
        self.scratch = self.root / "scratch"
        for folder in (self.root, self.work, self.scratch):
            folder.mkdir(mode=0o700)

    def copy_files(
        self, workdir: Path | None, source: bytes, weights: bytes | None = None
    ) -> None:
        """Copy the files of `workdir` to `work` and write the controller.

        Args:
            workdir: Folder with the files; None for none.
            source: Text of `controller.py`.
            weights: Content of `WEIGHTS`, if there is one.

        Raises:
            SandboxError: The folder cannot be read or is too large.
        """
        try:
            if workdir is not None:
                self._copy(workdir)
            (self.work / "controller.py").write_bytes(source)
            if weights is not None:
                (self.work / WEIGHTS).write_bytes(weights)
            for path in (*self.work.iterdir(), self.work):
                os.utime(path, (0, 0))  # they tell nothing of the judge's own files
        except OSError as error:
            raise SandboxError(f"cannot copy the working folder: {error}") from error

    def _copy(self, workdir: Path) -> None:
        room = MAX_FOLDER_BYTES
        for entry in sorted(workdir.iterdir()):
            if not entry.is_file() or entry.name == "controller.py":
                continue
            room -= entry.stat().st_size
            if room < 0:
                raise SandboxError(f"{workdir} is larger than {MAX_FOLDER_BYTES} B")
            shutil.copyfile(entry, self.work / entry.name)

    def remove(self) -> None:
        """Delete the folder, whatever the controller left in it.

        Folders are moved to the top before they are emptied: the controller may have
        nested them deeper than a path can express, and removed their permissions.
        """
        folders = [self.root]
        for count, folder in enumerate(folders):
            for entry in os.scandir(folder):
                if entry.is_dir(follow_symlinks=False):
                    lifted = self.root / f"lifted-{len(folders)}"
                    os.chmod(entry.path, 0o700)
                    if count:
                        os.rename(entry.path, lifted)
                    folders.append(lifted if count else Path(entry.path))
                else:
                    os.unlink(entry.path)
        for folder in reversed(folders):
            folder.rmdir()
