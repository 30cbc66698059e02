"""Rows that use tdac as a different user from the one who installed its wheel."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from commands import run, without
from place import Place
from table import CannotRun

NOBODY = 65534
# A user id as in containers, without an entry in /etc/passwd.
NAMELESS = 54321
PUBLIC = "/opt"
RECENT = "import ssl, sys; sys.exit(sys.version_info < (3, 11))"
PERSONAL = ("HOME", "USER", "LOGNAME", "PYTHONPATH", "VIRTUAL_ENV")


def wheel_user(place: Place) -> str:
    """A wheel installed by root and used by a user with a home."""
    return _first_commands(place, NOBODY, has_home=True)


def wheel_nohome(place: Place) -> str:
    """The same with a user id without a passwd entry and without HOME."""
    return _first_commands(place, NAMELESS, has_home=False)


def _first_commands(place: Place, user: int, has_home: bool) -> str:
    """Runs the first commands of a new user in an empty folder owned by that user.

    Raises:
        CannotRun: This user is not root and cannot act as another user.
    """
    if os.geteuid() != 0:
        raise CannotRun("only root can install for other users and act as one")
    python = _public_interpreter()
    here = Path(tempfile.mkdtemp(dir=place.folder, prefix="user-"))
    os.chown(here, user, user)
    env = without(os.environ, *PERSONAL, *(n for n in os.environ if n[:4] == "XDG_"))
    if has_home:
        env["HOME"] = str(here)
    with tempfile.TemporaryDirectory(dir=PUBLIC, prefix="tdac-wheel-") as name:
        tdac = _installed(place, Path(name), python)
        run([tdac, "doctor"], cwd=here, env=env, user=user)
        run([tdac, "synth"], cwd=here, env=env, user=user)
        run([tdac, "verify", "runs/maze-1"], cwd=here, env=env, user=user)
    return f"doctor, synth and verify as user id {user}, {python}"


def _installed(place: Place, folder: Path, python: str) -> Path:
    """The command `tdac` from a wheel, in a folder that only root can write to."""
    folder.chmod(0o755)
    wheels, venv = place.folder / "wheels", folder / "venv"
    place.run_uv("build", "--quiet", "--wheel", "--out-dir", wheels, place.tree)
    (wheel,) = wheels.glob("*.whl")
    place.run_uv("venv", "--quiet", "--python", python, venv)
    # As pip does: otherwise every command of another user compiles all its imports.
    compiled = ("--quiet", "--compile-bytecode")
    place.run_uv("pip", "install", *compiled, "--python", venv / "bin/python", wheel)
    return venv / "bin/tdac"


def _public_interpreter() -> str:
    """An interpreter that other users can run.

    Raises:
        CannotRun: There is none.
    """
    names = [Path(folder) / "python3" for folder in os.get_exec_path()]
    for path in (Path(sys.executable), *names):
        if path.exists() and _runs_for_all(path.resolve()):
            return str(path.resolve())
    raise CannotRun("no Python of at least 3.11 that other users can run is on PATH")


def _runs_for_all(path: Path) -> bool:
    command: list[str | Path] = [path, "-c", RECENT]
    try:
        done = subprocess.run(
            command,
            user=NAMELESS,
            group=NAMELESS,
            extra_groups=[],
            cwd="/",
            env={},
            capture_output=True,
            check=False,
        )
    except PermissionError:
        return False
    return done.returncode == 0
