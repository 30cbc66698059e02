"""All rows of the table, by name."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass

import emulated
import packaged
import suites
import tiers
import versions
from place import Place


@dataclass(frozen=True, slots=True)
class Row:
    """A check that must pass on other people's machines.

    Attributes:
        run: Runs the check and returns a summary.
        what: What it runs, in words.
        drawn: Whether CI may select it at random. False if it takes a quarter of an
            hour, or if CI always runs it.
    """

    run: Callable[[Place], str]
    what: str
    drawn: bool = True


ROWS = {
    "temporary": Row(
        suites.temporary, "make test below the temporary folder, no bubblewrap", False
    ),
    "tiers": Row(
        tiers.tiers, "sandbox tests, zoo's core, verdicts on every tier", False
    ),
    "verdicts": Row(tiers.verdicts, "a good and a bad controller on every tier", False),
    "lowest": Row(versions.lowest, "tests with the lowest direct versions"),
    "newest": Row(versions.newest, "tests with the newest versions"),
    "python3.12": Row(versions.python312, "tests on CPython 3.12"),
    "python3.13": Row(versions.python313, "tests on CPython 3.13"),
    "wheel-user": Row(
        packaged.wheel_user, "wheel installed by root, used by nobody", False
    ),
    "wheel-nohome": Row(packaged.wheel_nohome, "wheel, user id without name or HOME"),
    "qemu-nehalem": Row(emulated.nehalem, "rollout on an emulated Nehalem"),
    "qemu-haswell": Row(emulated.haswell, "rollout on an emulated Haswell"),
    "qemu-aarch64": Row(emulated.aarch64, "rollout on an emulated aarch64"),
    "nojit": Row(suites.nojit, "kernel tests with NUMBA_DISABLE_JIT=1"),
    "bounds": Row(suites.bounds, "kernel tests with NUMBA_BOUNDSCHECK=1"),
    "busy": Row(suites.busy, "make test beside four busy loops", False),
}


def drawn(seed: str) -> str:
    """The randomly selected row that CI runs in addition to the fixed ones.

    Args:
        seed: The commit's hash, so that rows vary and a run can be repeated.
    """
    return random.Random(seed).choice([name for name in ROWS if ROWS[name].drawn])
