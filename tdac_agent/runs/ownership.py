"""Which runs this installation began, and which permissions other runs need."""

from __future__ import annotations

import hmac
import json
import shlex
from collections.abc import Container, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from tdac_agent.errors import RunError
from tdac_agent.models.tariff import MAX_COST
from tdac_agent.prompting.prompt import is_shipped
from tdac_agent.runs.mark import MarkedJournal, files_of, is_marked, mark_of
from tdac_agent.runs.run_record import PROMPT_FILE, RUN_FILE, Run, at_work, load_run
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.hashes import sha256_of_file
from tdac_agent.tasks.installation import keyed, lasting_secret
from tdac_agent.tasks.task import Task, read_task
from tdac_agent.tasks.task_file import OWN_SUITE, SET_FILE, TaskFile
from tdac_agent.tasks.trust import Wish, asking, suite_wish

if TYPE_CHECKING:
    from tdac_agent.problems.task_set import SetProblem

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
    if not is_shipped(run.prompt) and "prompt" not in given:
        what = f"fill in the template {template}"
        digest = sha256_of_file(template) if template.is_file() else ""
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
    """The mark of a run of this installation, with the files that its folder has.

    It is empty if no secret can be kept, or if the tests cannot be hashed.
    """
    files = files_of(run.folder, suite)
    return "" if files is None else mark_of(run, files, MarkedJournal.of(run))


def is_own(run: Run, suite: Path | None) -> bool:
    """Whether this installation wrote a run, and what its mark covers is unchanged.

    Args:
        run: The run as recorded.
        suite: Folder with the tests of its task, as recorded.
    """
    return is_marked(run, suite)


def suite_in(folder: Path) -> Path | None:
    """The folder with the user's own tests of a run; None if there are none."""
    suite = folder / OWN_SUITE
    return suite if suite.is_dir() else None


def is_own_folder(run: Run) -> bool:
    """Like `is_own`, without reading the task: its tests are in the run folder."""
    return is_own(run, suite_in(run.folder))


def remark_on(run: Run) -> str:
    """What is to be said before a run is believed or resumed; empty for an own one."""
    if is_own_folder(run):
        return ""
    if has_earlier_mark(run):
        return f"{run.folder} is {_earlier(run)}"
    return (
        f"{run.folder} contains a run that this installation did not begin, or that "
        "was changed since"
    )


def called(run: Run) -> str:
    """The folder of a foreign run, with what makes an earlier version's own again."""
    return f"{run.folder}{f' ({_earlier(run)})' if has_earlier_mark(run) else ''}"


def _earlier(run: Run) -> str:
    about = ["--set", f"{run.folder}/{SET_FILE}", "--split", "hidden"]
    words = ["tdac", "verify", str(run.folder), *about[: 4 * run.on_set]]
    command = shlex.join(words)
    return f"marked by an earlier version; `{command}` marks it anew"


def has_earlier_mark(run: Run) -> bool:
    """Whether a run has a valid mark of an earlier version, which covered less."""
    facts, mark = _earlier_facts(run), run.mark.encode("utf-8", "surrogatepass")
    if facts is None or lasting_secret() is None:
        return False
    return hmac.compare_digest(mark, keyed(facts).hex().encode())


def mark_anew(run: Run) -> None:
    """Marks a run as its folder is now; only after all of that has been checked."""
    run.mark = sign(run, suite_in(run.folder))
    write_atomic(run.folder / RUN_FILE, run.model_dump_json(indent=2) + "\n")


def mark_verified(file: Path, about_sha256: str, profile: str) -> str:
    """Marks the run of an earlier version whose controller was verified again.

    Args:
        file: The controller.
        about_sha256: Hash of the task or task set that it was verified on.
        profile: The profile of the tests.

    Returns:
        What was done, as one line; empty if nothing was.
    """
    folder = file.parent
    try:
        run = load_run(folder)
    except RunError:
        return ""
    same = (run.task_sha256, run.profile, run.controller.name)
    wanted = run.tau is not None and same == (about_sha256, profile, file.name)
    if not wanted or at_work(folder) or not has_earlier_mark(run):
        return ""
    mark_anew(run)
    return f"{folder} is marked anew"


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


def load_set_problem(name: str | Path, hidden_folder: Path | None = None) -> SetProblem:
    """Reads a task set; the tests of a run of this installation may run.

    Args:
        name: Name of a shipped set, path of a `set.yaml`, or a run folder.
        hidden_folder: Folder with the held-out maps of a set of real maps.

    Raises:
        TaskError: The set cannot be read.
    """
    # Slow to import, and not needed on a task.
    from tdac_agent.problems.task_set import SetProblem
    from tdac_envs.ladder.task_sets import load_set

    tasks, path = load_set(name, hidden_folder), Path(name)
    folder = path.parent if path.name == SET_FILE else path
    suite = suite_in(folder) if (folder / RUN_FILE).is_file() else None
    if suite is None:
        return SetProblem(tasks)
    try:
        own = is_own(load_run(folder), suite)
    except (RunError, OSError):
        own = False
    return SetProblem(tasks, suite, trusted=own)


def _earlier_facts(run: Run) -> bytes | None:
    """What the mark of an earlier version covers; None if it cannot be computed."""
    try:
        files = files_of(run.folder, suite_in(run.folder))
    except OSError:
        return None
    if files is None:
        return None
    facts = {
        "learner": run.learner,
        "optimizer": run.optimizer,
        "base_url": run.base_url,
        "seed": run.seed,
        "max_cost": run.max_cost,
        "max_tokens": run.max_tokens,
        "template": files.template,
        "suite": files.suite,
    }
    if run.enough is not None:
        facts["enough"] = str(run.enough)
    return b"run|" + json.dumps(facts, sort_keys=True).encode()
