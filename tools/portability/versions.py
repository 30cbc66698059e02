"""Rows that run the tests with other versions of Python and of the dependencies."""

from __future__ import annotations

import sys
import tomllib

from commands import counted, own_environment, run
from place import Place, interpreter

# These pull in gigabytes for GPUs if no smaller build is available.
HEAVY = ("torch", "stable-baselines3", "sb3-contrib")


def lowest(place: Place) -> str:
    """The tests with the lowest direct versions."""
    return _tests(place, "lowest", sys.executable, "--resolution", "lowest-direct")


def newest(place: Place) -> str:
    """The tests with the newest versions."""
    return _tests(place, "newest", sys.executable, "--resolution", "highest")


def python312(place: Place) -> str:
    """The tests on Python 3.12."""
    return _tests(place, "python3.12", interpreter("3.12"))


def python313(place: Place) -> str:
    """The tests on Python 3.13."""
    return _tests(place, "python3.13", interpreter("3.13"))


def _tests(place: Place, name: str, version: str, *options: str) -> str:
    """Installs tdac with the test extra and runs the tests that are not slow."""
    needed = test_extra(place)
    heavy = [need for need in needed if need.startswith(HEAVY)]
    light = [need for need in needed if need not in heavy]
    python = place.environment(f"venv-{name}", version)
    install = ("pip", "install", "--python", python)
    left_out = ""
    if "nvidia" in place.run_uv(*install, "--dry-run", *heavy):
        left_out = f"; without {', '.join(HEAVY)}: they would pull in gigabytes"
    else:
        # Installed first, so that their lowest versions are not required below.
        place.run_uv(*install, *heavy)
    place.run_uv(*install, *options, "--editable", place.tree, *light)
    # After a crash, a new process would wait for ever for the files of the old one.
    parallel = ["-n", "2", "--dist", "loadfile", "--max-worker-restart", "0"]
    tests = ["-m", "pytest", "-q", *parallel, "-m", "not slow"]
    env = own_environment(TDAC_TEST_PART=place.part) if place.part else None
    told = "; half of the files, drawn" if place.part else ""
    return counted(run([python, *tests], cwd=place.tree, env=env)) + told + left_out


def test_extra(place: Place) -> list[str]:
    """The requirements of the test extra."""
    project = tomllib.loads((place.tree / "pyproject.toml").read_text())["project"]
    needed: list[str] = project["optional-dependencies"]["test"]
    return needed
