"""Packages of Debian, unpacked into a folder; they are not installed."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

from commands import run
from place import Place
from table import CannotRun, RowFailed


def unpacked(
    place: Place, packages: list[str], architecture: str = "", *, alone: bool = False
) -> Path:
    """A folder that holds the packages' files, as in `/`.

    Args:
        place: The working folder.
        packages: Their names.
        architecture: As Debian names it; the machine's own by default.
        alone: Without what they depend on, which the machine has.

    Raises:
        CannotRun: This is no Debian, or it does not give them.
    """
    for tool in ("apt-get", "dpkg"):
        if shutil.which(tool) is None:
            raise CannotRun(f"no {tool} here to fetch {', '.join(packages)} with")
    folder = place.folder / "-".join(["debian", *packages])
    if (folder / "root").exists():
        return folder / "root"
    try:
        _download(folder, packages, architecture, alone)
    except RowFailed as error:
        raise CannotRun(f"cannot get {', '.join(packages)}: {error}") from None
    for package in sorted(folder.glob("**/*.deb")):
        subprocess.run(["dpkg", "-x", package, folder / "root"], check=True)
    return folder / "root"


def _download(
    folder: Path, packages: list[str], architecture: str, alone: bool
) -> None:
    """Fetches with lists and a status of its own: of no package installed."""
    for part in ("state/lists/partial", "cache/archives/partial"):
        (folder / part).mkdir(parents=True)
    (folder / "status").touch()
    options = {
        "Dir::State": folder / "state",
        "Dir::State::status": folder / "status",
        "Dir::Cache": folder / "cache",
        "APT::Sandbox::User": "root",
        "APT::Install-Recommends": "false",
    }
    if architecture:
        options |= {
            "APT::Architecture": architecture,
            "APT::Architectures": architecture,
        }
    apt = ["apt-get", "-qq", *(f"-o{name}={text}" for name, text in options.items())]
    run([*apt, "update"], cwd=folder)
    way = ["download"] if alone else ["install", "--download-only", "--yes"]
    run([*apt, *way, *packages], cwd=folder)
