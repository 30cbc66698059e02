"""Adapts third-party packages to a process without a screen and without threads."""

from __future__ import annotations

import importlib.util
import os
import sys
import threading
from collections.abc import Callable, Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

from .messages import unsupported

_WINDOWS = {
    "imshow": None, "namedWindow": None, "moveWindow": None, "resizeWindow": None,
    "destroyWindow": None, "destroyAllWindows": None, "waitKey": -1, "waitKeyEx": -1,
    "setMouseCallback": None, "setWindowTitle": None, "createTrackbar": None,
    "getTrackbarPos": 0, "startWindowThread": 0, "pollKey": -1,
}  # fmt: skip


def prepare() -> None:
    """Makes matplotlib draw without a screen and OpenCV's windows do nothing."""
    scratch = os.environ.get("TMPDIR", ".")
    os.environ.update(
        MPLBACKEND="Agg", MPLCONFIGDIR=scratch, OPENCV_FOR_THREADS_NUM="1"
    )
    _tolerate_timers()
    sys.meta_path.insert(0, _Patching())


def _tolerate_timers() -> None:
    """Ignores a timer that cannot start: matplotlib uses one only for a warning."""
    original: Callable[[Any], None] = threading.Timer.start

    def start_if_possible(timer: threading.Thread) -> None:
        try:
            original(timer)
        except RuntimeError:
            return

    threading.Timer.start = start_if_possible  # type: ignore[assignment, method-assign]


def _without_windows(cv2: ModuleType) -> None:
    for name, result in _WINDOWS.items():
        setattr(cv2, name, unsupported(f"cv2.{name}", result))


def _without_screen(matplotlib: ModuleType) -> None:
    """Keeps the backend that needs no screen, whatever backend a program selects."""
    matplotlib.use = lambda *_, **__: None  # type: ignore[attr-defined]


def _quiet(pyplot: ModuleType) -> None:
    for name in ("show", "pause"):
        setattr(pyplot, name, unsupported(f"matplotlib.pyplot.{name}"))


_PATCHES: dict[str, Callable[[ModuleType], None]] = {
    "cv2": _without_windows,
    "matplotlib": _without_screen,
    "matplotlib.pyplot": _quiet,
}


class _Patching:
    """Finder that patches a module in `_PATCHES` after its first import."""

    def __init__(self) -> None:
        self._begun: set[str] = set()

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The spec of a module of `_PATCHES`, which is then patched; else None."""
        del path, target
        if name not in _PATCHES or name in self._begun:
            return None
        self._begun.add(name)
        spec = importlib.util.find_spec(name)
        if spec is None or spec.loader is None:
            return None
        loader: Any = spec.loader
        execute = loader.exec_module

        def exec_module(module: ModuleType) -> None:
            execute(module)
            _PATCHES[name](sys.modules[name])

        loader.exec_module = exec_module
        return spec
