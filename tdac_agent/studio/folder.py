"""The folder of the studio, in which others may have put files and links."""

from __future__ import annotations

import errno
import io
import zipfile
from pathlib import Path

from tdac_agent.storage.files import resolved, write_atomic
from tdac_envs.core.intake import IMAGE_BYTES, RECORD_BYTES, read_file

STATE = ".studio"
"""Folder of the studio in the folder where it was started."""
FILES = f"{STATE}/files"
"""Folder of what was uploaded or made for a run."""

CONTROLLER_FILES = (
    "controller.py",
    "sensors.py",
    "params.json",
    "occupancy.npy",
    "occupancy.png",
    "robot.png",
    "world.wbt",
)
"""What a controller finds in its working folder, as far as the run has it."""


def within(place: Path, at: str) -> Path | None:
    """A path in the folder of the studio; None if it leads out of it.

    Args:
        place: Folder of the studio.
        at: The path, relative to it.
    """
    try:
        path = resolved(place / at)
        inside = path.is_relative_to(place.resolve())
    except (OSError, ValueError, RuntimeError):  # a null byte, or links in a circle
        return None
    return path if inside else None


def made_within(place: Path, at: str) -> Path:
    """Makes a folder in the folder of the studio, unless it is there.

    Raises:
        OSError: It cannot be made, or a link leads out of the folder of the studio.
    """
    if within(place, at) is None:
        raise OSError(errno.EPERM, "leads out of this folder; remove the link", at)
    (place / at).mkdir(parents=True, exist_ok=True)
    return place / at


def keep(place: Path, at: str, data: bytes) -> None:
    """Writes a file in the folder of the studio; a link in its place is replaced.

    Raises:
        OSError: It cannot be written, or a link leads out of the folder of the studio.
    """
    folder = made_within(place, str(Path(at).parent))
    write_atomic(folder / Path(at).name, data, lasting=False)


def lines_in(file: Path) -> int:
    """The number of lines of a file that grows; 0 if it cannot be read."""
    try:
        return len(read_file(file, RECORD_BYTES).splitlines())
    except OSError:
        return 0


def as_word(at: str) -> str:
    """A path as a word of a command line that is not taken for a flag."""
    return f"./{at}" if at.startswith("-") else at


def folders_with(place: Path, file: str) -> list[str]:
    """Folders with a file, such as that of a bench, in or below a folder.

    Args:
        place: Folder of the studio.
        file: Name of the file.
    """
    folders = {path.parent for at in ("*/", "*/*/") for path in place.glob(at + file)}
    return sorted(str(folder.relative_to(place)) for folder in folders)


def deployable(folder: Path) -> bytes:
    """The controller of a run with the files that it may read, as a ZIP file."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in CONTROLLER_FILES:
            file = within(folder, name)
            if file is not None and file.is_file():
                archive.writestr(name, read_file(file, IMAGE_BYTES))
    return packed.getvalue()
