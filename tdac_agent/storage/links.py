"""Links in a folder of somebody else, through which a program would write elsewhere."""

from __future__ import annotations

import os
from collections.abc import Iterator
from fnmatch import fnmatchcase
from pathlib import Path

from tdac_agent.errors import RunError
from tdac_agent.storage.files import resolved


def refuse_links(folder: Path, *names: str) -> None:
    """Refuses a folder if a link leads out of it where a command writes.

    The folder itself may be a link; it is the user who names it.

    Args:
        folder: The folder; it may be missing.
        names: Files and subfolders in it that the command writes, or patterns such as
            `*.png`; `*` for a folder that is the command's alone.

    Raises:
        RunError: There is such a link.
    """
    inside = folder.resolve()
    for path in _written(inside, names):
        if path.is_symlink() and not _target(path).is_relative_to(inside):
            raise RunError(
                f"{folder / path.relative_to(inside)} is a link that leads out of "
                f"{folder}, and this command writes there: put what it leads to "
                "in its place"
            )


def _written(folder: Path, names: tuple[str, ...]) -> Iterator[Path]:
    """The entries of a folder with one of these names, and all that is in them."""
    for top in folder.iterdir() if folder.is_dir() else ():
        if not any(fnmatchcase(top.name, name) for name in names):
            continue
        yield top
        # What is not a folder, or a link to one, has nothing to walk.
        for name, folders, files in () if top.is_symlink() else os.walk(top):
            yield from (Path(name, each) for each in (*folders, *files))


def _target(link: Path) -> Path:
    """Where a link leads; the root if it leads in a circle."""
    try:
        return resolved(link)
    except (OSError, RuntimeError):
        return Path("/")
