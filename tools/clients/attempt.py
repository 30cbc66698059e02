"""Installs one library in its own virtual environment and trains with it."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from libraries import ROOT, Library

PASSED, FAILED, NOT_RUN = "passed", "failed", "not run"
_VERSIONS = (
    "import sys; from importlib.metadata import version; "
    "print(', '.join(f'{name} {version(name)}' for name in sys.argv[1:]))"
)


@dataclass(frozen=True)
class Outcome:
    """The result for one library.

    Attributes:
        name: Name of the library.
        trained: What the program trains.
        versions: Versions of the library and of Gymnasium, if it was installed.
        result: `PASSED`, `FAILED` or `NOT_RUN`.
        said: Last line of the program, or the reason.
    """

    name: str
    trained: str
    versions: str
    result: str
    said: str


def attempt(name: str, library: Library, work: Path, timeout: float) -> Outcome:
    """Tries one library; the outcome states any error."""
    if library.missing:
        return Outcome(name, library.trained, "", NOT_RUN, library.missing)
    folder = work / name
    python = folder / "bin" / "python"
    reason = "" if python.exists() else _run([sys.executable, "-m", "venv", folder])[1]
    reason = reason or _install(python, library)
    if reason:
        return Outcome(name, library.trained, "", NOT_RUN, reason)
    _, _, versions = _run([python, "-c", _VERSIONS, *library.shown, "gymnasium"])
    training = [python, *library.program]
    _, reason, said = _run(training, timeout=timeout, folder=folder)
    result = FAILED if reason else PASSED
    return Outcome(name, library.trained, versions, result, reason or said)


def _install(python: Path, library: Library) -> str:
    """Installs a library and tdac; returns why it failed, or an empty string."""
    pip = [python, "-m", "pip", "install", "--quiet"]
    # torch first: otherwise a library selects its newest build, which may be larger.
    if library.torch:
        reason = _run([*pip, _torch()])[1]
        if reason:
            return f"pip: {reason}"
    reason = _run([*pip, "-e", ROOT, *library.needs])[1]
    return f"pip: {reason}" if reason else ""


def _torch() -> str:
    """The requirement for torch from the extra `test`."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    test: list[str] = project["project"]["optional-dependencies"]["test"]
    return next(line for line in test if line.startswith("torch"))


def _run(
    command: Sequence[str | Path],
    *,
    timeout: float | None = None,
    folder: Path | None = None,
) -> tuple[int, str, str]:
    """Exit code, last line of the errors if it is not 0, last line of the output."""
    try:
        done = subprocess.run(
            [str(part) for part in command],
            cwd=folder,
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return 1, f"did not end within {timeout:g} s", ""
    said, wrong = _last(done.stdout), _last(done.stderr)
    if done.returncode == 0:
        return 0, "", said
    return done.returncode, wrong or said or f"exit code {done.returncode}", said


def _last(text: str) -> str:
    """The last line of a text that is not empty."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else ""
