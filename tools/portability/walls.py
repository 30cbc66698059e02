"""Environments with and without bubblewrap on PATH."""

from __future__ import annotations

import os
import shutil

from commands import own_environment
from debian import unpacked
from place import Place

PROGRAM = "bwrap"


def hidden(place: Place) -> dict[str, str]:
    """This process's environment, with a PATH without bubblewrap.

    A folder of PATH that contains it is replaced by one with links to everything else.
    """
    folders = []
    for number, folder in enumerate(os.get_exec_path()):
        if os.path.exists(os.path.join(folder, PROGRAM)):
            folders.append(_links_to_all_else(place, number, folder))
        else:
            folders.append(folder)
    path = os.pathsep.join(folders)
    assert shutil.which(PROGRAM, path=path) is None
    return own_environment(PATH=path)


def _links_to_all_else(place: Place, number: int, folder: str) -> str:
    links = place.folder / f"without-{PROGRAM}-{number}"
    if not links.exists():
        links.mkdir()
        for name in os.listdir(folder):
            if name != PROGRAM:
                (links / name).symlink_to(os.path.join(folder, name))
    return str(links)


def shown(place: Place) -> dict[str, str]:
    """This process's environment, with a PATH with bubblewrap.

    Raises:
        CannotRun: It is not installed and cannot be fetched.
    """
    if shutil.which(PROGRAM) is not None:
        return own_environment()
    root = unpacked(place, ["bubblewrap"], alone=True)
    return own_environment(PATH=f"{root / 'usr/bin'}{os.pathsep}{os.environ['PATH']}")
