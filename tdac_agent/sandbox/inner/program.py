"""Run a whole program, such as a Webots controller, while the judge steps its world."""

from __future__ import annotations

import importlib
import os
import shutil
import sys
from types import ModuleType
from typing import Any

from .describe import FILE_NAME

PACKAGE = "controller"
PROJECT = "project-of-the-controller"
"""Folder beside the program with the rest of its project."""
CONTROLLERS, LIBRARIES = "controllers", "libraries"


def run_program(
    source: bytes, name: str, arguments: list[str], world: Any
) -> int | str | None:
    """Run a program as `__main__`; return what it passes to `sys.exit`, or None.

    It runs in a writable copy of its folder, in the folder `controllers` of a project.
    The folder `libraries` of the project and the folders in it are at the end of
    Python's path, where they cannot hide other modules.

    Args:
        source: Source of the program.
        name: Name of its folder.
        arguments: Entries of `sys.argv` after the first.
        world: Passed to the package `controller` in the program's folder.
    """
    project = os.path.join(os.environ["TMPDIR"], "project")
    folder = _copy_project(os.getcwd(), project, name)
    os.chdir(folder)
    sys.path[0] = folder
    sys.path += _folders_of(os.path.join(project, LIBRARIES))
    sys.argv[1:] = arguments
    importlib.import_module(PACKAGE).connect(world)
    main = ModuleType("__main__")
    main.__file__ = FILE_NAME
    sys.modules["__main__"] = main
    code = compile(source, FILE_NAME, "exec", dont_inherit=True)
    try:
        exec(code, main.__dict__)
    except SystemExit as ended:
        status = ended.code
        if not (status is None or isinstance(status, int)):
            print(status, file=sys.stderr)  # as Python does
        return status if status is None or type(status) is int else str(status)[:200]
    return None


def _copy_project(source: str, project: str, name: str) -> str:
    """Copy a program with the rest of its project; return the program's folder."""
    rest = os.path.join(source, PROJECT)
    if os.path.isdir(rest):
        _copy(rest, project)
    else:
        os.makedirs(os.path.join(project, CONTROLLERS))
    folder = os.path.join(project, CONTROLLERS, name)
    _copy(source, folder, leave_out=PROJECT)
    return folder


def _copy(source: str, target: str, leave_out: str = "") -> None:
    """Copy a folder but not its permissions, which a sandboxed process may not set."""
    os.mkdir(target)
    for entry in os.scandir(source):
        copy = os.path.join(target, entry.name)
        if entry.name == leave_out:
            continue
        if entry.is_dir():
            _copy(entry.path, copy)
        else:
            shutil.copyfile(entry.path, copy)


def _folders_of(libraries: str) -> list[str]:
    if not os.path.isdir(libraries):
        return []
    inner = sorted(entry.path for entry in os.scandir(libraries) if entry.is_dir())
    return [libraries, *inner]
