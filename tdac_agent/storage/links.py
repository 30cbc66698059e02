"""Links in a folder of somebody else, through which a program would write elsewhere."""

from __future__ import annotations

import os
from pathlib import Path

from tdac_agent.errors import RunError


def refuse_links(folder: Path) -> None:
    """Refuses a folder from which a link leads out.

    The folder itself may be a link; it is the user who names it.

    Raises:
        RunError: There is such a link.
    """
    inside = folder.resolve()
    for name, folders, files in os.walk(inside):
        for each in (*folders, *files):
            path = Path(name, each)
            if path.is_symlink() and not _target(path).is_relative_to(inside):
                raise RunError(
                    f"{folder / path.relative_to(inside)} is a link that leads out of "
                    f"{folder}, and this command writes there: put what it leads to "
                    "in its place"
                )


def _target(link: Path) -> Path:
    """Where a link leads; the root if it leads in a circle."""
    try:
        return link.resolve()
    except (OSError, RuntimeError):
        return Path("/")
