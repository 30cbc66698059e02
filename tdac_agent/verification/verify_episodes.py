"""Verifies a controller in many episodes: disturbed ones of a task, or new worlds."""

from __future__ import annotations

import contextlib
import itertools
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tdac_agent.errors import RunError
from tdac_agent.problems.episodes import episodes_of
from tdac_agent.problems.part import Part
from tdac_agent.runs.run_record import load_run
from tdac_agent.sandbox import Limits
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.installation import seed_of
from tdac_agent.tasks.task import Task
from tdac_agent.verification.drive_episodes import Request, drive
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.judge.policy_spec import PolicySpec
from tdac_agent.verification.judge.sequential import (
    CLEAN,
    MARGIN,
    MOST_EPISODES,
    SequentialTest,
)
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.run_episodes import Watch
from tdac_agent.verification.verify import read_source
from tdac_envs.core.arguments import one_of, whole_number
from tdac_envs.core.errors import TaskError
from tdac_envs.core.salt import read_salt

if TYPE_CHECKING:
    from tdac_envs.ladder.task_sets import TaskSet

EPISODES = 200
"""Default number of disturbed episodes of a task."""
MOST_WORLDS = 400
"""Worlds after which a sequential test of a set is undecided."""
DEEPEST = 5
"""How many folders above a controller file its run may be."""
JUDGED = ("dev", "test", "hidden")
SEED_ON_SETS = (
    "--seed has no effect on a task set without tests of your own (--suite): all that "
    "happens in an episode follows from its world; --split NAME, and --first M with "
    "-n N, choose worlds"
)


def verify_episodes(
    controller: str | bytes | Path,
    problem: Task | TaskSet,
    episodes: int | None = None,
    *,
    split: str = "test",
    first: int | None = None,
    disturbance: Disturbance | None = None,
    accept_at: float | None = None,
    margin: float = MARGIN,
    salt_file: Path | None = None,
    lineage: str | None = None,
    tier: str = "auto",
    limits: Limits | None = None,
    out: Path | None = None,
    trajectories: bool | None = None,
    judge: WarmJudge | None = None,
    watch: Watch | None = None,
    suite: Path | None = None,
    seed: int | None = None,
) -> EpisodeReport:
    """Drives a controller in disturbed episodes of a task, or on worlds of a set.

    Each episode depends only on the problem and its number, and has a fresh sandboxed
    process. On a set, static and contract tests come first, and with `suite` the user's
    own: without a pass in them, nothing is driven. An evaluation on hidden worlds is
    recorded in the user's ledger before its worlds are driven; one that is recorded
    there is answered from it.

    Args:
        controller: Path of the file, or its source (text of several lines, or bytes).
        problem: A task; or a task set, one of files with its `hidden_folder`, if
            `split` is `hidden`.
        episodes: Number of episodes; with `accept_at`, the maximum. By default 200 of a
            task; of a set, as many as a sequential test of its bar needs.
        split: Split of a set: `dev`, `test` or `hidden`.
        first: Number of the first episode; the others count up from it. Of a task, it
            is a seed, by default one that no author of a controller can predict; of a
            set, the number of a world, by default 0, and only with `episodes`.
        disturbance: Disturbance of a task's environment.
        accept_at: Stops as soon as a sequential test decides whether the success rate
            is at least `accept_at`, or at most `accept_at - margin`. The report then
            has no rate and no interval.
        margin: See `accept_at`.
        salt_file: File with the salt of the split `hidden`.
        lineage: Id of the run that wrote the controller, for the ledger; by default
            the id of the run folder that the file is in, if it is in one.
        tier: Sandbox tier; `auto` for the best one on this machine.
        limits: Limits of the controller's process in each episode.
        out: Folder for `episodes.json` and `trajectories/`; of hidden worlds, for
            `episodes.json` and `sealed/`, which only this user can read. Without a
            sequential test, an interrupted call leaves its episodes there, and the
            same call goes on.
        trajectories: Whether trajectories are kept; by default only on sets.
        judge: A warm judge; None starts one for this call.
        watch: Called repeatedly with the numbers of episodes and successes so far.
        suite: Folder of the user's own tests for a set, which may run (docs/suites.md);
            `out` then also gets their `report.json`. Tests for a task belong to
            `verify`.
        seed: Seed of what these tests draw; by default derived from the controller, the
            set and a secret of this installation.

    Raises:
        ControllerFileError: The file cannot be read.
        TaskError: An argument is not valid or needs another one, the environment does
            not have a part of the disturbance, or the ledger cannot be used.
        Fault: The sandbox is broken; the controller neither passes nor fails.
        RunError: A link leads out of `out`, where the results are written.
    """
    source, own_tests = read_source(controller), None
    if seed is not None and suite is None:
        raise TaskError(SEED_ON_SETS)
    if not isinstance(problem, Task):
        if disturbance is not None:
            raise TaskError("a task set has its own disturbances")
        part, test = part_of_set(
            problem, split, episodes, first, salt_file, accept_at, margin
        )
        if suite is not None:
            # Task sets need much that a task does not.
            from tdac_agent.verification.own_tests import run_own_tests

            tests = partial(run_own_tests, source, problem, suite, seed=seed)
            own_tests = partial(tests, tier=tier, out=out, judge=judge)
    else:
        if suite is not None:
            raise TaskError("suite: on a task, verify runs it; leave it out here")
        problem.disturbed_options(disturbance or problem.own_disturbance())
        count = EPISODES if episodes is None else episodes
        whole_number("episodes", count, 1, MOST_EPISODES)
        if first is not None:
            whole_number("first", first, 0)
        begin = seed_of(source, problem) if first is None else first
        part = Part(range(begin, begin + count), disturbance=disturbance)
        test = None if accept_at is None else SequentialTest(accept_at, count, margin)
    keeps = not isinstance(problem, Task) if trajectories is None else trajectories
    request = Request(
        PolicySpec("controller"),
        sha256_of(source),
        episodes_of(problem),
        part,
        source,
        test,
        lineage or written_by(controller),
        tier=tier,
        limits=limits,
        trajectories=keeps,
        own_tests=own_tests,
    )
    return drive(request, out, judge, watch)


def part_of_set(
    tasks: TaskSet,
    split: str,
    worlds: int | None,
    first: int | None = None,
    salt_file: Path | None = None,
    accept_at: float | None = None,
    margin: float = MARGIN,
) -> tuple[Part, SequentialTest | None]:
    """Worlds of a split; without a number of them, also a test that ends them.

    Raises:
        TaskError: An argument is not valid.
    """
    one_of("split", split, JUDGED)
    begin = whole_number("first", first or 0, 0)
    if begin > 0 and (worlds is None or split == "hidden"):
        raise TaskError("first: needs a number, and another split than 'hidden'")
    if worlds is not None:
        whole_number("episodes", worlds, 1, MOST_EPISODES)
        tasks.check_count(split, begin + worlds, "worlds")
    salt = None if salt_file is None else read_salt(salt_file)
    tasks.key(split, 0, "world", salt)  # checks that salt and split belong together
    count = most_worlds(tasks, split) if worlds is None else worlds
    bar = tasks.file.bar if accept_at is None and worlds is None else accept_at
    test = None
    if bar is not None and accept_at is not None:
        test = SequentialTest(bar, count, margin)
    elif bar is not None:
        test = _verdict_of(tasks, count, margin)
    return Part(range(begin, begin + count), split, salt_file), test


def _verdict_of(tasks: TaskSet, count: int, margin: float) -> SequentialTest:
    """The tests of arrivals and contacts on so many worlds of a set.

    Raises:
        TaskError: They are too few to show that either is good enough.
    """
    clean = CLEAN - (1.0 - tasks.file.most_contacts)
    try:
        contact = SequentialTest(CLEAN, count, clean)
        return SequentialTest(tasks.file.bar, count, margin, contact=contact)
    except TaskError as error:
        raise TaskError(
            f"{tasks.name} has too few worlds for a verdict: {error} (arrivals, or "
            f"drives without a contact); -n {count} asks for scores"
        ) from None


def written_by(controller: str | bytes | Path) -> str | None:
    """Id of the run in whose folder a controller file is; None if it is in none."""
    if isinstance(controller, bytes) or "\n" in str(controller):
        return None
    for folder in itertools.islice(Path(controller).resolve().parents, DEEPEST):
        with contextlib.suppress(RunError):
            return load_run(folder).id or None
    return None


def most_worlds(tasks: TaskSet, split: str) -> int:
    """Number of worlds after which a sequential test on a split is undecided.

    It drives each world once: further runs on a world are not independent of it.
    """
    count = tasks.different(split)
    return MOST_WORLDS if count is None else min(MOST_WORLDS, count)


def verify_robust(
    controller: str | bytes | Path,
    task: Task,
    episodes: int = EPISODES,
    *,
    first_seed: int | None = None,
    **options: Any,
) -> EpisodeReport:
    """`verify_episodes` of a task, by its earlier name and arguments."""
    return verify_episodes(controller, task, episodes, first=first_seed, **options)


def verify_on_set(
    controller: str | bytes | Path,
    tasks: TaskSet,
    split: str = "test",
    worlds: int | None = None,
    **options: Any,
) -> EpisodeReport:
    """`verify_episodes` of a task set, by its earlier name and arguments."""
    return verify_episodes(controller, tasks, worlds, split=split, **options)
