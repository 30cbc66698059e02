"""The files of this machine that a child may see."""

from __future__ import annotations

import functools
import os
import sys
import sysconfig
from dataclasses import dataclass
from pathlib import Path

import numpy as np

INNER = Path(__file__).resolve().parent / "inner"
FOREIGN_PACKAGES = ("site-packages", "dist-packages")


@dataclass(frozen=True, slots=True)
class Exposure:
    """Files that a child may read; everything else stays hidden.

    Attributes:
        interpreter: The Python program itself, not the link of a virtual environment.
        system: The standard library, shared libraries and the loader.
        hidden: Folders below `system` with other packages, which stay hidden.
        packages: numpy, its libraries, and the child's own code.
        devices: Harmless devices.
        links: Symbolic links in the root folder, (path, target).
    """

    interpreter: str
    system: tuple[str, ...]
    hidden: tuple[str, ...]
    packages: tuple[str, ...]
    devices: tuple[str, ...]
    links: tuple[tuple[str, str], ...]


@functools.cache
def exposure() -> Exposure:
    """Return the files that the running interpreter needs."""
    # Only `_base_executable` names the program behind a virtual environment.
    program = os.path.realpath(getattr(sys, "_base_executable", sys.executable))
    stdlib = os.path.dirname(os.path.realpath(os.__file__))
    extensions = {os.path.realpath(p) for p in sys.path if p.endswith("lib-dynload")}
    folders = _outermost({stdlib, *extensions, *_library_folders()})
    # Only the folder is resolved: programs refer to the loader by its unresolved name.
    roots = [Path(folder).resolve() for folder in ("/lib", "/lib64")]
    loaders = [str(path) for root in roots for path in root.glob("ld-*.so*")]
    files = [program, *loaders, "/etc/ld.so.cache", "/etc/alternatives"]
    return Exposure(
        interpreter=program,
        system=(*folders, *_existing(*files)),
        hidden=tuple(_foreign(folders)),
        packages=(*numpy_folders(), str(INNER)),
        devices=_existing("/dev/null", "/dev/zero", "/dev/urandom"),
        links=tuple(
            (path, os.readlink(path))
            for path in ("/lib", "/lib64", "/lib32", "/bin", "/sbin")
            if os.path.islink(path)
        ),
    )


def installed_packages() -> tuple[str, ...]:
    """Return the folders of the packages installed for the running interpreter."""
    paths = sysconfig.get_paths()
    folders = dict.fromkeys(os.path.realpath(paths[k]) for k in ("purelib", "platlib"))
    return tuple(folder for folder in folders if os.path.isdir(folder))


def numpy_folders() -> tuple[str, ...]:
    """Return the folders of numpy and of its bundled libraries."""
    package = Path(np.__file__).resolve().parent
    return tuple(
        str(folder)
        for folder in (package, package.parent / "numpy.libs")
        if folder.is_dir()
    )


def _existing(*paths: str) -> tuple[str, ...]:
    return tuple(path for path in paths if os.path.exists(path))


def _library_folders() -> set[str]:
    """Return the folders of the shared libraries that this process has mapped."""
    # raw read: of the kernel
    with open("/proc/self/maps", encoding="utf-8", errors="replace") as maps:
        paths = {line.split(maxsplit=5)[5].rstrip() for line in maps if ".so" in line}
    return {
        os.path.dirname(path)
        for path in paths
        if path.startswith("/") and not any(n in path for n in FOREIGN_PACKAGES)
    }


def _outermost(folders: set[str]) -> list[str]:
    kept: list[str] = []
    for folder in sorted(folders):
        if os.path.isdir(folder) and not any(
            folder.startswith(outer + os.sep) for outer in kept
        ):
            kept.append(folder)
    return kept


def _foreign(folders: list[str]) -> list[str]:
    paths: set[str] = set()
    for folder in folders:
        for name in FOREIGN_PACKAGES:
            for pattern in (name, f"*/{name}"):
                paths.update(str(path) for path in Path(folder).glob(pattern))
    return sorted(paths)


@functools.cache
def visible_entries(seen: Exposure) -> tuple[list[str], list[str]]:
    """Return `system` without `hidden`, for a sandbox that cannot mask a folder.

    Returns:
        Paths that are readable recursively, and folders that can only be listed.
    """
    readable, listable = [], []
    pending = list(seen.system)
    while pending:
        path = pending.pop()
        if path in seen.hidden:
            continue
        if any(hidden.startswith(path + os.sep) for hidden in seen.hidden):
            listable.append(path)
            pending += [entry.path for entry in os.scandir(path)]
        else:
            readable.append(path)
    return readable, listable
