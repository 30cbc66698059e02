"""The working folder of the rows, with a clone and its virtual environment."""

from __future__ import annotations

import functools
import os
import subprocess
import sys
from pathlib import Path

from commands import run
from table import CannotRun

ROOT = Path(__file__).resolve().parents[2]


class Place:
    """The working folder; everything that rows need is created once, on demand.

    Attributes:
        folder: The folder.
        command: Command that `temporary` and `busy` run in the clone.
        part: Seed that draws the half of the test files that rows with other versions
            run; empty for all files.
    """

    def __init__(self, folder: Path, command: list[str], part: str = "") -> None:
        # Commands that run as another user need access.
        folder.chmod(0o755)
        self.folder = folder
        self.command = command
        self.part = part

    @functools.cached_property
    def tree(self) -> Path:
        """A fresh clone of the last commit, or the existing one."""
        tree = self.folder / "tree"
        if tree.exists():
            return tree
        run(["git", "clone", "--quiet", ROOT, tree], cwd=self.folder)
        if subprocess.run(
            ["git", "status", "--porcelain"],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            check=True,
        ).stdout:
            print("uncommitted changes are not in the clone", flush=True)
        shared = ROOT.parent / "shared"
        if shared.is_dir():
            # The tests look here for third-party maps and worlds.
            (self.folder / "shared").symlink_to(shared)
        return tree

    @functools.cached_property
    def python(self) -> Path:
        """The interpreter of the clone's own `.venv`, with the test extra."""
        run(
            ["make", f"PYTHON={sys.executable}", ".venv/.test-installed"], cwd=self.tree
        )
        return self.tree / ".venv/bin/python"

    @functools.cached_property
    def uv(self) -> Path:
        """uv, in a separate environment."""
        home = self.folder / "uv"
        run([sys.executable, "-m", "venv", home], cwd=self.folder)
        run([home / "bin/pip", "install", "--quiet", "uv"], cwd=self.folder)
        return home / "bin/uv"

    def run_uv(self, *words: str | Path) -> str:
        """Runs uv with the interpreters on this machine."""
        env = {**os.environ, "UV_PYTHON_DOWNLOADS": "never"}
        if links := os.environ.get("PIP_FIND_LINKS"):
            env.setdefault("UV_FIND_LINKS", links)
        return run([self.uv, *words], cwd=self.folder, env=env)

    def environment(self, name: str, python: str) -> Path:
        """The interpreter of a new, empty virtual environment."""
        venv = self.folder / name
        self.run_uv("venv", "--quiet", "--python", python, venv)
        return venv / "bin/python"


def interpreter(version: str) -> str:
    """An interpreter of a version such as "3.12", from PATH or pyenv.

    Raises:
        CannotRun: There is none.
    """
    name = f"python{version}"
    folders = [Path(folder) for folder in os.get_exec_path()]
    folders += sorted(Path.home().glob(f".pyenv/versions/{version}.*/bin"))
    for path in (folder / name for folder in folders):
        if path.exists() and _has_version(path, version):
            return str(path)
    raise CannotRun(f"{name} is neither on PATH nor among pyenv's versions")


def _has_version(path: Path, version: str) -> bool:
    """Whether an interpreter runs and has a version; a shim may fail at both."""
    code = "import sys; print('%d.%d' % sys.version_info[:2])"
    done = subprocess.run(
        [path, "-c", code], capture_output=True, text=True, check=False
    )
    return done.stdout.strip() == version
