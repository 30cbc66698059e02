"""Drives our own controllers on worlds of a set in this process, without a sandbox.

The steps and the scores are those of the judge. Nothing is confined, and no CPU budget
is enforced: only for controllers of this repository and variations of their constants.
"""

from __future__ import annotations

import contextlib
import importlib.util
import math
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from tdac_agent.episodes.episode import not_driven, run_policy
from tdac_agent.sandbox import ControllerFault
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.verification.judge.episode_job import row_of
from tdac_agent.verification.judge.episode_row import EpisodeRow
from tdac_agent.verification.judge.set_files import write_files
from tdac_agent.verification.judge.set_worlds import SetEpisodes, open_set
from tdac_agent.verification.judge.worlds import SetWorlds


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
        with _blamed("reset"):
            return self._module.reset(observation)

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


class Drives:
    """Episodes by controller and world; each of them is driven once.

    Args:
        level: Name or file of the task set.
    """

    def __init__(self, level: str) -> None:
        self._level = level
        self._worlds: dict[str, SetEpisodes] = {}
        self._driven: dict[tuple[str, str, int], EpisodeRow] = {}

    def __call__(self, source: str, split: str, index: int) -> EpisodeRow:
        """The episode of a controller on a world."""
        key = sha256_of(source.encode()), split, index
        if key not in self._driven:
            self._driven[key] = self._drive(source, split, index)
        return self._driven[key]

    def _drive(self, source: str, split: str, index: int) -> EpisodeRow:
        if split not in self._worlds:
            own = SetWorlds(set_file=Path(self._level), split=split)
            self._worlds[split] = open_set(own)
        worlds, began = self._worlds[split], time.process_time()
        env, record = worlds.env, worlds.record(index)
        with tempfile.TemporaryDirectory(prefix="tdac-drive-") as name:
            folder = Path(name)
            write_files(folder, env.set.file, env.setup.source.task(index))
            (folder / "controller.py").write_text(source, encoding="utf-8")
            # Overflows of wild constants are the controller's own affair.
            with contextlib.chdir(folder), np.errstate(all="ignore"):
                try:
                    terms = {"held_out": False, "deadline": math.inf}
                    driver = Imported(folder)
                    rollout = run_policy(driver, record, f"world {index}", **terms)
                except ControllerFault as fault:
                    rollout = not_driven(record, f"world {index}", fault)
        cpu = time.process_time() - began
        return row_of(worlds, index, rollout, env, cpu)
