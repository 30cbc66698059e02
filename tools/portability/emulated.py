"""Rows that run the environments on other processors, emulated by QEMU."""

from __future__ import annotations

import hashlib
import json
import math
import platform
import shutil
from pathlib import Path

from commands import own_environment, run
from debian import unpacked
from place import Place
from table import CannotRun, RowFailed

SCRIPT = Path(__file__).with_name("rollout.py")
TOLERANCE = 1e-6


def nehalem(place: Place) -> str:
    """A rollout on a processor of 2008, without AVX."""
    return _x86(place, "Nehalem")


def haswell(place: Place) -> str:
    """A rollout on a processor of 2013, with AVX2 and without AVX-512."""
    return _x86(place, "Haswell")


def aarch64(place: Place) -> str:
    """A rollout on aarch64, with Debian's Python and the wheels for it."""
    program = _qemu(place, "aarch64")
    root = unpacked(place, ["python3", "libstdc++6"], "arm64")
    (python,) = root.glob("usr/bin/python3.*[0-9]")
    packages = _wheels(place, python.name.removeprefix("python"))
    env = own_environment(PYTHONPATH=f"{place.tree}:{packages}")
    return _compared(place, "aarch64", [program, "-L", root, python, SCRIPT], env)


def _x86(place: Place, processor: str) -> str:
    if platform.machine() != "x86_64":
        raise CannotRun("it uses the packages of this machine, so it needs x86-64")
    program = _qemu(place, "x86_64")
    command = [program, "-cpu", processor, place.python, SCRIPT]
    return _compared(
        place, processor, command, own_environment(PYTHONPATH=str(place.tree))
    )


def _qemu(place: Place, machine: str) -> str:
    """The emulator of an architecture, from PATH or Debian's package."""
    names = (f"qemu-{machine}", f"qemu-{machine}-static")
    for name in names:
        if found := shutil.which(name):
            return found
    root = unpacked(place, ["qemu-user-static"], alone=True)
    for name in names:
        if (root / "usr/bin" / name).is_file():
            return str(root / "usr/bin" / name)
    raise CannotRun(f"Debian's qemu-user-static has no {names[1]}")


def _wheels(place: Place, version: str) -> Path:
    """A folder with tdac's dependencies from wheels for aarch64.

    Raises:
        CannotRun: A dependency has no such wheel.
    """
    folder = place.folder / "aarch64"
    platform_ = (
        "--python-platform",
        "aarch64-manylinux_2_28",
        "--python-version",
        version,
    )
    into = (
        "--only-binary",
        ":all:",
        "--target",
        folder,
        "-r",
        place.tree / "pyproject.toml",
    )
    try:
        place.run_uv("pip", "install", *platform_, *into)
    except RowFailed as error:
        raise CannotRun(
            f"not all dependencies have a wheel for aarch64: {error}"
        ) from None
    return folder


def _compared(
    place: Place, name: str, command: list[object], env: dict[str, str]
) -> str:
    """Runs the rollout on this processor and the emulated one, and compares them.

    Raises:
        RowFailed: The numbers differ by more than rounding.
    """
    here, there = place.folder / "here.json", place.folder / f"{name}.json"
    if not here.exists():
        own = own_environment(PYTHONPATH=str(place.tree))
        run([place.python, SCRIPT, here], cwd=place.folder, env=own)
    run([*command, there], cwd=place.folder, env=env)
    expected, got = (json.loads(file.read_text()) for file in (here, there))
    if expected == got:
        digest = hashlib.sha256(here.read_bytes()).hexdigest()[:12]
        return f"bit-identical to this machine: {digest}"
    wrong = [key for key in expected if not _near(expected[key], got[key])]
    if wrong:
        raise RowFailed(f"different numbers than on this machine: {', '.join(wrong)}")
    apart = max(
        abs(a - b)
        for key in expected
        for a, b in zip(expected[key], got[key], strict=True)
    )
    return f"as on this machine except for rounding, at most {apart:.1g}"


def _near(expected: list[float], got: list[float]) -> bool:
    return len(expected) == len(got) and all(
        math.isclose(a, b, rel_tol=TOLERANCE, abs_tol=TOLERANCE)
        for a, b in zip(expected, got, strict=True)
    )
