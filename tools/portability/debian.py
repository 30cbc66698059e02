"""Unpacks Debian packages into a folder without installing them."""

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
    """A folder with the packages' files, laid out as in `/`.

    Args:
        place: The working folder.
        packages: Names of the packages.
        architecture: Debian's name of the architecture; by default the machine's own.
        alone: Whether to leave out dependencies, because the machine has them.

    Raises:
        CannotRun: This is not Debian, or the packages are not available.
    """
    for tool in ("apt-get", "dpkg"):
        if shutil.which(tool) is None:
            raise CannotRun(f"fetching {', '.join(packages)} needs {tool}")
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
    """Downloads with separate apt lists, and a status without installed packages."""
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
    verb = ["download"] if alone else ["install", "--download-only", "--yes"]
    run([*apt, *verb, *packages], cwd=folder)
