"""Rows that test each tier of the sandbox by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from commands import counted, run
from place import Place
from table import CannotRun, RowFailed
from walls import hidden, shown

Environment = Mapping[str, str]
Check = Callable[[Place, Environment, list[str]], str]
WORKING = """
from tdac_agent.sandbox import available_tiers
for status in available_tiers():
    print("tier", status.tier.name, "works" if status.works else status.reason)
"""
STANDS_STILL = "def policy(obs):\n    return 0.0, 0.0\n"
NOT_VERIFIED = 1
# Repeated, to catch failures that occur only now and then; the blind drives once.
TRIES = 3


def verdicts(place: Place) -> str:
    """One good and one bad controller on every tier, without and with bubblewrap."""
    return _without_and_with(place, _verdicts)


def tiers(place: Place) -> str:
    """The tests of the sandbox, the zoo's core and the verdicts, in the same way."""
    return _without_and_with(place, _tests_and_verdicts)


def _without_and_with(place: Place, check: Check) -> str:
    """Runs a check for the working tiers without bubblewrap, and if possible with it.

    Returns:
        A summary that also gives the reason if bubblewrap could not be used.
    """
    env = hidden(place)
    summary = f"without bubblewrap: {check(place, env, _working(place, env))}"
    try:
        env = shown(place)
    except CannotRun as reason:
        return f"{summary}; with it: not run, {reason}"
    names = _working(place, env)
    if "bubblewrap" not in names:
        return f"{summary}; with it: not run, it does not work on this machine"
    return f"{summary}; with it: {check(place, env, names)}"


def _working(place: Place, env: Environment) -> list[str]:
    """Names of the tiers that work in an environment, best first."""
    text = run([place.python, "-c", WORKING], cwd=place.tree, env=env)
    lines = [line.split() for line in text.splitlines() if line.startswith("tier ")]
    if not lines:
        raise RowFailed("no tier was printed")
    return [words[1] for words in lines if words[2] == "works"]


def _tests_and_verdicts(place: Place, env: Environment, names: list[str]) -> str:
    python, tree = place.python, place.tree
    tests = ["-m", "pytest", "-q", "-m", "not slow", "tests/agent/sandbox"]
    counts = counted(run([python, *tests], cwd=tree, env=env))
    for name in names:
        zoo = ["tests/agent/zoo/run.py", "--core", "--tier", name]
        run([python, *zoo], cwd=tree, env=env)
    return f"{counts}, the zoo's core, {_verdicts(place, env, names)}"


def _verdicts(place: Place, env: Environment, names: list[str]) -> str:
    good, bad = _controllers(place, env)
    verify = [place.python, "-m", "tdac_agent", "verify"]
    for name in names:
        run([*verify, good, "--tier", name], cwd=place.folder, env=env)
        for _ in range(TRIES - 1):
            again = [*verify, good, "--no-confirm", "--tier", name]
            run(again, cwd=place.folder, env=env)
        command = [*verify, bad, "--profile", "policy", "--tier", name]
        run(command, cwd=place.folder, env=env, expect=NOT_VERIFIED)
    return f"verdicts on {' '.join(names)}"


def _controllers(place: Place, env: Environment) -> tuple[Path, Path]:
    """A verified run folder, and a controller that does not move."""
    good, bad = place.folder / "good", place.folder / "bad.py"
    if not good.exists():
        synth = [place.python, "-m", "tdac_agent", "synth", "--out", good]
        run(synth, cwd=place.folder, env=env)
    bad.write_text(STANDS_STILL)
    return good, bad
