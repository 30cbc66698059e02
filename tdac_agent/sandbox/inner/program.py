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


def run_program(source: bytes, arguments: list[str], world: Any) -> int | str | None:
    """Run a program as `__main__`; return what it passes to `sys.exit`, or None.

    It runs in a writable copy of its folder.

    Args:
        source: Source of the program.
        arguments: Entries of `sys.argv` after the first.
        world: Passed to the package `controller` in the program's folder.
    """
    folder = os.path.join(os.environ["TMPDIR"], "program")
    _copy(os.getcwd(), folder)
    os.chdir(folder)
    sys.path[0] = folder
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


def _copy(source: str, target: str) -> None:
    """Copy a folder but not its permissions, which a sandboxed process may not set."""
    os.mkdir(target)
    for entry in os.scandir(source):
        copy = os.path.join(target, entry.name)
        if entry.is_dir():
            _copy(entry.path, copy)
        else:
            shutil.copyfile(entry.path, copy)
