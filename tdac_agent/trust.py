"""What a folder or a file of somebody else's may not do by itself: run, or reach out.

A run folder, a task, a campaign is data. What of it runs on this machine outside the
sandbox, spends money or is sent something is used only where this installation began
the folder, where the same flag is given, or with `--trust`.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import shlex
import sys
from collections.abc import Container, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from tdac_agent.installation import keyed, lasting_secret
from tdac_agent.prompt import VARIANTS
from tdac_agent.records import PROMPT_FILE, Run
from tdac_agent.tariff import MAX_COST
from tdac_agent.task import Task
from tdac_envs.errors import TdacError
from tdac_envs.intake import RECORD_BYTES, read_file

OWN_SUITE = "suite"
"""Folder of a run's tests, beside the shipped ones."""
OURS = "builtin"
"""The learner that runs nothing and asks nobody."""
MOST_FILES, MOST_BYTES = 2000, 64 << 20
"""Of a suite."""
SHORT = 12
"""Digits of a hash that are shown."""


class NotTrustedError(TdacError):
    """Somebody else's file wants what only the user may allow; a line for each."""

    def __init__(self, lines: Iterable[str]) -> None:
        self.lines = tuple(lines)
        super().__init__("; ".join(self.lines))


@dataclass(frozen=True, slots=True)
class Wish:
    """One thing that a folder or a file wants.

    Attributes:
        what: In words, as in `run the tests in DIR`.
        flag: Words of the command line that allow it; none but `--trust` where empty.
        sha256: Of the files that would run.
    """

    what: str
    flag: tuple[str, ...] = ()
    sha256: str = ""

    def __str__(self) -> str:
        return (
            f"{self.what} (sha256 {self.sha256[:SHORT]})" if self.sha256 else self.what
        )


def permit(whose: str | Path, wishes: Iterable[Wish], *, trust: bool) -> None:
    """Lists what is allowed by `--trust`, or refuses.

    Args:
        whose: Folder or file.
        wishes: What it wants and was not given by a flag.
        trust: Whether the user trusts it, this time.

    Raises:
        NotTrustedError: With a line for each wish.
    """
    lines = [
        (wish, f"{whose}, which was not begun here, wants to {wish}") for wish in wishes
    ]
    if not trust and lines:
        raise NotTrustedError(
            f"{line}: allow it with {_ways(wish)}" for wish, line in lines
        )
    for wish, _ in lines:
        print(f"trusted for this once: {whose} may {wish}", file=sys.stderr)


def _ways(wish: Wish) -> str:
    given = f"{shlex.join(wish.flag)}, or with " if wish.flag else ""
    return f"{given}--trust"


def allowed(task: Task, suite: Path | None, *, trust: bool) -> Task:
    """A task with the tests that the user wants, or trusts.

    Args:
        task: As its file tells.
        suite: Folder of the flag `--suite`, in the place of the task's own tests.
        trust: Whether the user trusts the file, this time.

    Raises:
        NotTrustedError: It brings tests, and nothing allows them.
    """
    if suite is not None:
        return replace(task, suite=suite, trusted=True)
    if task.suite is not None and not task.trusted:
        permit(task.folder or task.name, [suite_wish(task.suite)], trust=trust)
    return replace(task, trusted=True)


def suite_wish(suite: Path) -> Wish:
    """To run the tests of a folder, which are not in the sandbox."""
    digest = tree_sha256(suite)
    return Wish(f"run the tests in {suite}", ("--suite", str(suite)), digest or "")


def wishes_of(run: Run, task: Task, given: Container[str]) -> Iterator[Wish]:
    """What a run of somebody else's wants when it goes on, but for what is given.

    Args:
        run: As its folder tells.
        task: As its folder tells.
        given: Names of the arguments of `synthesize` that the user gave, and `suite`.
    """
    if "learner" not in given and run.learner != OURS:
        yield Wish(asking("learner", run.learner), ("--learner", run.learner))
    if "optimizer" not in given and run.optimizer not in {OURS, run.learner}:
        yield Wish(asking("optimizer", run.optimizer), ("--optimizer", run.optimizer))
    if run.base_url is not None and "base_url" not in given:
        what = f"send its questions, with your key, to {run.base_url}"
        yield Wish(what, ("--base-url", run.base_url))
    template = run.folder / PROMPT_FILE
    if run.prompt not in VARIANTS and "prompt" not in given:
        what = f"fill in the template {template}"
        digest = file_sha256(template) if template.is_file() else ""
        yield Wish(what, ("--prompt", str(template)), digest)
    if task.suite is not None and "suite" not in given:
        yield suite_wish(task.suite)
    if run.seed is not None and "seed" not in given:
        what = f"choose where the moved starts lie (seed {run.seed})"
        yield Wish(what, ("--seed", str(run.seed)))
    if run.max_cost is not None and run.max_cost > MAX_COST and "max_cost" not in given:
        what = f"spend up to {run.max_cost:g} USD"
        yield Wish(what, ("--max-cost", f"{run.max_cost:g}"))


def asking(role: str, name: str) -> str:
    """What a model is wanted for, in words."""
    kind, _, words = name.partition(":")
    if kind == "command":
        return f"run the program `{words}` as its {role}"
    return f"ask {name} as its {role}"


def sign(run: Run, suite: Path | None) -> str:
    """The mark of a run that this installation begins; empty where no secret lasts.

    It is a MAC over all of the run that can run, reach out or spend. Its files are in
    its folder by now.
    """
    facts = _facts(run, suite)
    if facts is None or lasting_secret() is None:
        return ""
    return keyed(facts).hex()


def is_own(run: Run, suite: Path | None) -> bool:
    """Whether this installation has begun a run, and what it may do is as it was.

    Args:
        run: As its folder tells.
        suite: Of its task, as its folder tells.
    """
    return bool(run.mark) and hmac.compare_digest(
        run.mark.encode(), sign(run, suite).encode()
    )


def is_own_folder(run: Run) -> bool:
    """The same of a run whose task is not read: its tests lie in its folder."""
    suite = run.folder / OWN_SUITE
    return is_own(run, suite if suite.is_dir() else None)


def _facts(run: Run, suite: Path | None) -> bytes | None:
    """All of a run that matters, as one text; None where a suite is none."""
    template, tests = run.folder / PROMPT_FILE, ""
    if suite is not None:
        found = tree_sha256(suite)
        if found is None:
            return None
        tests = found
    facts = {
        "learner": run.learner,
        "optimizer": run.optimizer,
        "base_url": run.base_url,
        "seed": run.seed,
        "max_cost": run.max_cost,
        "max_tokens": run.max_tokens,
        "template": file_sha256(template) if template.is_file() else "",
        "suite": tests,
    }
    return b"run|" + json.dumps(facts, sort_keys=True).encode()


def file_sha256(path: Path) -> str:
    """Hash of a file."""
    return hashlib.sha256(read_file(path, RECORD_BYTES)).hexdigest()


def tree_sha256(folder: Path) -> str | None:
    """Hash of all files below a folder, byte code left out; it is never used.

    None where there are links, things that are no files, or far too many.
    """
    hashes: dict[str, str] = {}
    size = 0
    for path in sorted(folder.rglob("*")):
        inside = path.relative_to(folder)
        if "__pycache__" in inside.parts:
            continue
        if path.is_symlink() or not (path.is_dir() or path.is_file()):
            return None
        if path.is_file():
            size += path.stat().st_size
            if len(hashes) >= MOST_FILES or size > MOST_BYTES:
                return None
            hashes[str(inside)] = file_sha256(path)
    return hashlib.sha256(json.dumps(hashes).encode()).hexdigest()
