"""Runs our own controllers in this process, without a sandbox.

Nothing is confined, and no CPU budget is enforced: only for controllers of this
repository and variations of their constants.
"""

from __future__ import annotations

import contextlib
import importlib.util
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

from tdac_agent.sandbox import ControllerFault


class Imported:
    """A controller as a `Driver`; what it raises is its own fault.

    Args:
        folder: Folder with `controller.py` and its files, the working folder.
    """

    def __init__(self, folder: Path) -> None:
        spec = importlib.util.spec_from_file_location("c", folder / "controller.py")
        assert spec is not None
        assert spec.loader is not None
        self._module: ModuleType = importlib.util.module_from_spec(spec)
        with _blamed("import"):
            spec.loader.exec_module(self._module)

    def reset(self, observation: dict[str, Any]) -> object:
        begin = getattr(self._module, "reset", None)
        with _blamed("reset"):
            return None if begin is None else begin(observation)

    def policy(self, observation: dict[str, Any]) -> Any:
        with _blamed("policy"):
            return self._module.policy(observation)

    def waited(self) -> float:
        return 0.0


@contextlib.contextmanager
def _blamed(phase: str) -> Iterator[None]:
    try:
        yield
    except Exception as error:
        raise ControllerFault(f"{type(error).__name__}: {error}", phase) from error
