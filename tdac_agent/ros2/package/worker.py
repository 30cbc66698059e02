"""Run a controller in a thread of its own, so that the node stays in command."""

from __future__ import annotations

import hashlib
import importlib.util
import os
from pathlib import Path
import queue
import sys
import threading
from typing import Any


SUMS = 'sha256sums.txt'
"""File of the controller's folder with the hash of each other file, as by sha256sum."""


def sums_of(folder: Path) -> str:
    """Return the hashes of the files of a folder, one per line, without `SUMS`."""
    found = []
    for file in sorted(folder.rglob('*')):
        name = file.relative_to(folder).as_posix()
        if file.is_file() and name != SUMS and '__pycache__' not in file.parts:
            data = file.read_bytes()  # raw read: installed
            found.append(f'{hashlib.sha256(data).hexdigest()}  {name}\n')
    return ''.join(found)


def check_files(folder: Path) -> None:
    """
    Check that a controller's folder has the exported files and no others.

    Raises ValueError that names a file if not.
    """
    if not (folder / SUMS).is_file():
        raise ValueError(f'{folder} has no {SUMS}: export it again')
    written = set((folder / SUMS).read_text(encoding='utf-8').splitlines())  # raw read: installed
    for line in sorted(written ^ set(sums_of(folder).splitlines())):
        raise ValueError(
            f'{folder / line[66:]} is not as exported (missing, changed or added): export again')


class Worker:
    """
    The functions `reset` and `policy` of a controller.

    The controller is plain Python code with the rights of this process. It is imported with
    its folder as the working folder, as when it was verified; the first answer includes the
    import and `reset`.

    Args:
        folder: Folder with `controller.py` and the files that it reads.
        sha256: Hash of `controller.py`.

    Raises ValueError if the file has another hash, OSError if it cannot be read.
    """

    def __init__(self, folder: Path, sha256: str) -> None:
        self._folder = folder.resolve()
        self._module: Any = None
        source = (self._folder / 'controller.py').read_bytes()  # raw read: installed
        found = hashlib.sha256(source).hexdigest()
        if found != sha256:
            raise ValueError(
                f'{folder / "controller.py"} is not the exported file: its SHA-256 is {found}')
        self._questions: queue.Queue[dict[str, Any]] = queue.Queue()
        self._answers: queue.Queue[tuple[str, Any]] = queue.Queue()
        threading.Thread(target=self._work, daemon=True).start()

    def ask(self, observation: dict[str, Any]) -> None:
        """Begin with an answer."""
        self._questions.put(observation)

    def answer(self, wait: float) -> tuple[str, Any] | None:
        """Return ('action', (left, right)) or ('error', text); None if there is none yet."""
        try:
            return self._answers.get(timeout=wait) if wait > 0 else self._answers.get_nowait()
        except queue.Empty:
            return None

    def _work(self) -> None:
        while True:
            observation = self._questions.get()
            answer: tuple[str, Any]
            try:
                answer = ('action', _wheels(self._policy(observation)))
            except BaseException as error:  # SystemExit, too: the node must not end by it
                answer = ('error', f'the controller failed: {type(error).__name__}: {error}')
            self._answers.put(answer)

    def _policy(self, observation: dict[str, Any]) -> Any:
        if self._module is None:
            self._module = _imported(self._folder)
            reset = getattr(self._module, 'reset', None)
            if reset is not None:
                reset({name: value.copy() for name, value in observation.items()})
        return self._module.policy(observation)


def _imported(folder: Path) -> Any:
    sys.dont_write_bytecode = True
    os.chdir(folder)
    sys.path.insert(0, str(folder))
    for file in folder.glob('*.py'):  # another controller may have imported its own
        sys.modules.pop(file.stem, None)
    spec = importlib.util.spec_from_file_location('controller', folder / 'controller.py')
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules['controller'] = module
    spec.loader.exec_module(module)
    return module


def _wheels(action: Any) -> tuple[float, float]:
    """Return an action as two finite numbers."""
    left, right = (float(value) for value in action)
    if not abs(left) < 1e30 or not abs(right) < 1e30:
        raise ValueError(f'expected two finite numbers, got {action!r:.100}')
    return left, right
