"""Which runs this installation began, and which permissions other runs need."""

from __future__ import annotations

import hmac
import json
from collections.abc import Container, Iterator
from dataclasses import replace
from pathlib import Path

from tdac_agent.errors import RunError
from tdac_agent.models.tariff import MAX_COST
from tdac_agent.prompting.prompt import VARIANTS
from tdac_agent.runs.run_record import PROMPT_FILE, Run, load_run
from tdac_agent.tasks.installation import keyed, lasting_secret
from tdac_agent.tasks.task import Task, read_task
from tdac_agent.tasks.task_file import OWN_SUITE, TaskFile
from tdac_agent.tasks.trust import Wish, asking, file_sha256, suite_wish, tree_sha256

OURS = "builtin"
"""The learner that needs no permission."""


def wishes_of(run: Run, suite: Path | None, given: Container[str]) -> Iterator[Wish]:
    """Yields the permissions that resuming another installation's run needs.

    Args:
        run: The run as recorded.
        suite: Folder with the user's own tests, as recorded.
        given: Arguments of `synthesize`, or `suite`, which need no permission.
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
    if suite is not None and "suite" not in given:
        yield suite_wish(suite)
    if run.seed is not None and "seed" not in given:
        what = f"choose the jittered starts (seed {run.seed})"
        yield Wish(what, ("--seed", str(run.seed)))
    if run.max_cost is not None and run.max_cost > MAX_COST and "max_cost" not in given:
        what = f"spend up to {run.max_cost:g} USD"
        yield Wish(what, ("--max-cost", f"{run.max_cost:g}"))


def sign(run: Run, suite: Path | None) -> str:
    """The mark of a run of this installation; empty if no secret can be kept.

    It is a MAC over everything in the run that can execute code, reach a server or
    spend money. The files of the run must be in its folder already.
    """
    facts = _facts(run, suite)
    if facts is None or lasting_secret() is None:
        return ""
    return keyed(facts).hex()


def is_own(run: Run, suite: Path | None) -> bool:
    """Whether this installation began a run, and what its mark covers is unchanged.

    Args:
        run: The run as recorded.
        suite: Folder with the tests of its task, as recorded.
    """
    mark = run.mark.encode("utf-8", "surrogatepass")
    return bool(mark) and hmac.compare_digest(mark, sign(run, suite).encode())


def is_own_folder(run: Run) -> bool:
    """Like `is_own`, without reading the task: its tests are in the run folder."""
    suite = run.folder / OWN_SUITE
    return is_own(run, suite if suite.is_dir() else None)


def load_task(
    source: str | Path | TaskFile, *, base: Path | None = None, trust: bool = False
) -> Task:
    """Reads and checks a task; the tests of a run of this installation may run.

    Args:
        source: Name of a bundled task, path of a `task.yaml`, folder that contains
            one, or its contents.
        base: Folder that relative paths in the contents refer to. Default: the task
            file's folder.
        trust: Whether the tests that a task file brings may always run.

    Raises:
        TaskError: The file or the task cannot be used; the message says what to do.
        MapError: The map cannot be used.
        WorldError: The world cannot be used.
    """
    task = read_task(source, base=base, trust=trust)
    if task.trusted or task.suite is None or task.folder is None:
        return task
    try:
        own = is_own(load_run(task.folder), task.suite)
    except (RunError, OSError):
        own = False
    return replace(task, trusted=own)


def _facts(run: Run, suite: Path | None) -> bytes | None:
    """What the mark of a run covers; None if the suite cannot be hashed."""
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
    if run.enough is not None:
        facts["enough"] = str(run.enough)
    return b"run|" + json.dumps(facts, sort_keys=True).encode()
