"""Files that somebody else offers: what a command does with them, within which limits.

An offer is a folder with hostile files and a command line that reads them. Whatever is
in it, the command ends with the exit code that the offer names and one line, or none if
the code is 0, in little time and memory, and leaves nothing behind.
"""

from __future__ import annotations

import importlib.util
import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

SECONDS = 60.0
MEMORY = 1_500_000_000
"""Bytes at most, of which torch has a third."""
KEPT_BACK = 4_000_000_000
"""Bytes that a command gets at all, so that no attack ends the machine."""
Maker = Callable[[Path], object]


@dataclass(frozen=True, slots=True)
class Offer:
    """A hostile folder.

    Attributes:
        surface: What kind of file it is about.
        name: Of the attack.
        words: Command line, given in the folder.
        make: Writes the files.
        says: Pattern of the line on stderr.
        code: Exit code.
        endless: Whether who reads it carelessly has to be stopped from outside.
        needs: Module without which nobody gets so far.
        memory: Bytes that the command may take.
    """

    surface: str
    name: str
    words: tuple[str, ...]
    make: Maker
    says: str
    code: int = 2
    endless: bool = False
    needs: str = ""
    memory: int = MEMORY

    def __str__(self) -> str:
        return f"{self.surface}/{self.name}"


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a command did."""

    code: int
    errors: str
    seconds: float
    memory: int
    left: tuple[str, ...]
    made: tuple[str, ...]


def take(offer: Offer) -> Outcome:
    """Gives a command what is offered, in a process of its own."""
    with tempfile.TemporaryDirectory(prefix="zoo-offer-") as name:
        here, temporary = Path(name, "here"), Path(name, "temporary")
        here.mkdir()
        temporary.mkdir()
        offer.make(here)
        before = _inside(here)
        began = time.monotonic()
        with (Path(name) / "errors").open("w+b") as errors:
            process = subprocess.Popen(
                [sys.executable, "-m", "tdac_agent", *offer.words],
                cwd=here,
                env=os.environ | {"TMPDIR": str(temporary)},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=errors,
                start_new_session=True,
            )
            resource.prlimit(process.pid, resource.RLIMIT_DATA, (KEPT_BACK, KEPT_BACK))
            code, memory = _ended(process)
            seconds = time.monotonic() - began
            errors.seek(0)
            told = errors.read().decode("utf-8", "backslashreplace")
        left, made = sorted(_inside(temporary)), sorted(_inside(here) - before)
        return Outcome(code, told, seconds, memory, tuple(left), tuple(made))


def differences(offer: Offer, outcome: Outcome) -> list[str]:
    """How an outcome differs from what the offer must come to."""
    found = line_problems(offer, outcome.code, outcome.errors)
    found += excesses(outcome, offer.memory)
    if outcome.made:
        found.append(f"made {', '.join(outcome.made)}")
    return found


def excesses(outcome: Outcome, memory: int = MEMORY) -> list[str]:
    """What a command took or left that none may."""
    found = []
    if outcome.seconds >= SECONDS:
        found.append(f"took {outcome.seconds:.0f} s")
    if outcome.memory > memory:
        found.append(f"took {outcome.memory / 1e6:.0f} MB")
    if outcome.left:
        found.append(f"left {', '.join(outcome.left)}")
    return found


def line_problems(offer: Offer, code: int, errors: str) -> list[str]:
    """What is wrong with an exit code and the line on stderr; none if all is well."""
    found = []
    lines = 1 if offer.code else 0
    if code != offer.code:
        found.append(f"exit {code}, expected {offer.code}: {errors[-400:]}")
    elif len(errors.strip().splitlines()) != lines or len(errors) > 1000:
        found.append(f"expected {lines} lines: {errors[:400]}")
    elif not re.search(offer.says, errors):
        found.append(f"expected {offer.says!r}: {errors}")
    return found


def all_offers() -> list[Offer]:
    """Every offer of the zoo."""
    import offered_maps
    import offered_policies
    import offered_records
    import offered_robots
    import offered_tasks
    import offered_weights
    import offered_worlds

    modules = (
        offered_maps,
        offered_worlds,
        offered_tasks,
        offered_records,
        offered_robots,
        offered_policies,
        offered_weights,
    )
    return [offer for module in modules for offer in module.OFFERS]


def chosen_offers(names: list[str]) -> list[Offer]:
    """The offers of these names or surfaces, or all; none that lack what they need."""
    return [
        offer
        for offer in all_offers()
        if (not names or {offer.name, offer.surface, str(offer)} & set(names))
        and (not offer.needs or importlib.util.find_spec(offer.needs))
    ]


def wrong_offers(offers: list[Offer], workers: int, console: Console) -> int:
    """Takes some offers, prints a count by surface; how many went wrong."""
    right: dict[str, list[bool]] = {offer.surface: [] for offer in offers}
    with ThreadPoolExecutor(workers) as pool:
        for offer, outcome in zip(offers, pool.map(take, offers), strict=True):
            problems = differences(offer, outcome)
            right[offer.surface].append(not problems)
            mark = "  <-- not as expected" if problems else ""
            told = f"{outcome.seconds:5.1f} s {outcome.memory / 1e6:5.0f} MB{mark}"
            console.print(f"{offer!s:36} exit {outcome.code} {told}", markup=False)
            for problem in problems:
                console.print(f"    {problem[:600]}", markup=False)
    for surface, results in right.items():
        told = f"{len(results)} offers, {results.count(False)} not as expected"
        console.print(f"{surface}: {told}")
    return sum(results.count(False) for results in right.values())


def _ended(process: subprocess.Popen[bytes]) -> tuple[int, int]:
    """Exit code and peak memory of a process; its session is ended if it is late."""
    late, peak = time.monotonic() + SECONDS, 0
    while process.poll() is None:
        peak = max(peak, _peak(process.pid))
        if time.monotonic() > late:
            os.killpg(process.pid, signal.SIGKILL)
        time.sleep(0.02)
    return process.returncode, peak


def _peak(pid: int) -> int:
    """Most memory that a process had until now; that of its parent does not count."""
    status = Path(f"/proc/{pid}/status").read_text()
    found = re.search(r"VmHWM:\s+(\d+) kB", status)
    return int(found[1]) * 1024 if found else 0


def _inside(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}
