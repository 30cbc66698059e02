"""Drives a policy in many episodes in the judge's process, and stores the results."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import BaseModel, ConfigDict, Field

from tdac_agent.episodes.deviated import plain_env
from tdac_agent.episodes.episode import Driver, not_driven, run_policy
from tdac_agent.episodes.trajectory import Rollout
from tdac_agent.sandbox import Child, ControllerFault, Limits, SandboxError
from tdac_agent.sandbox.folder import WEIGHTS_BYTES
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.printable_record import PrintableRecord
from tdac_agent.tasks.setting import JudgedEnv
from tdac_agent.tasks.task import read_task
from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.confirming import EndingTest
from tdac_agent.verification.judge.deviated import DeviatedEpisodes
from tdac_agent.verification.judge.episode_row import EpisodeRow, driven_row
from tdac_agent.verification.judge.in_order import in_order
from tdac_agent.verification.judge.policy_spec import PolicySpec
from tdac_agent.verification.judge.set_checks import (
    CHECKED_STEPS,
    CHECKS_FILE,
    STABLE,
    Checks,
    static_checks,
)
from tdac_agent.verification.judge.task_world import TaskEpisodes
from tdac_agent.verification.judge.worlds import (
    FOREVER,
    DeviatedWorlds,
    Program,
    SetWorlds,
    TaskWorld,
    Worlds,
    public_split,
)
from tdac_envs.core.errors import TaskError
from tdac_envs.core.intake import RECORD_BYTES, read_file

if TYPE_CHECKING:
    from tdac_agent.verification.judge.set_worlds import SetEpisodes

EPISODES_FILE, ENDING_FILE = "episodes.jsonl", "ending.json"
MOST_ROW_BYTES = 512 << 20
UNSANDBOXED = "none"
"""Reported as the tier of policies that run without a sandbox."""


class EpisodeJob(BaseModel):
    """Episodes to drive; all paths are absolute.

    Attributes:
        worlds: Where they take place.
        policy: Who drives.
        numbers: Their numbers, in order.
        checks: Whether static and contract tests come first; without a pass, nothing is
            driven.
        test: Stops early, once it has decided.
        told: Whether more may be told of a failure than its cause.
        patience: Time-outs after which the rest is skipped; None for never.
        tier: Sandbox tier.
        limits: Limits of each episode's process.
        out: Folder of the results.
        rows: File in which an interrupted job finds what it has driven already.
        trajectories: Folder for the trajectory of each episode, `NUMBER.npz`.
        series: Whether further jobs follow in the same process, equal to this one but
            for cases, numbers, and `out`.
    """

    model_config = ConfigDict(extra="forbid")

    kind: Literal["episodes"] = "episodes"
    worlds: TaskWorld | SetWorlds | DeviatedWorlds = Field(discriminator="kind")
    policy: PolicySpec
    numbers: tuple[int, ...]
    checks: bool = False
    test: EndingTest | None = None
    told: bool = True
    patience: int | None = None
    tier: str
    limits: Limits
    out: Path
    rows: Path | None = None
    trajectories: Path | None = None
    series: bool = False


class JobEnding(PrintableRecord):
    """What the judge's process found in addition to the episodes.

    `fault` is why the sandbox failed, `problem` what is wrong with the task.
    """

    model_config = ConfigDict(extra="forbid")

    tier: str
    fault: str | None = None
    problem: str | None = None


@dataclass(frozen=True, slots=True)
class EpisodeSummary:
    """What is kept of an episode; see `in_order.Timed`."""

    row: EpisodeRow
    tier: str
    late: bool
    is_retryable: bool


Drive = Callable[[EpisodeJob], Iterable[EpisodeSummary]]
"""Drives the episodes of a job."""


@dataclass(frozen=True, slots=True, eq=False)
class Driven:
    """An episode as it was driven.

    Attributes:
        rollout: The judged episode.
        row: Its row.
        tier: Sandbox tier.
    """

    rollout: Rollout
    row: EpisodeRow
    tier: str


@dataclass(frozen=True, slots=True, eq=False)
class EpisodeRun:
    """Everything that the episodes of a job share.

    Attributes:
        job: The job.
        child_pool: The child pool.
        worlds: Where they take place.
        program: The controller, if one drives.
    """

    job: EpisodeJob
    child_pool: ChildPool
    worlds: TaskEpisodes | SetEpisodes | DeviatedEpisodes
    program: Program

    @classmethod
    def of(cls, job: EpisodeJob, child_pool: ChildPool) -> EpisodeRun:
        """Opens the worlds, and reads the controller."""
        policy = job.policy
        file = policy.file if policy.kind == "controller" else None
        source = b"" if file is None else read_file(file, RECORD_BYTES)
        weights = None
        if policy.weights is not None:
            weights = read_file(policy.weights, WEIGHTS_BYTES)
        return cls(job, child_pool, opened(job.worlds), Program(source, weights))


def opened(
    worlds: TaskWorld | SetWorlds | DeviatedWorlds,
) -> TaskEpisodes | SetEpisodes | DeviatedEpisodes:
    """Opens the worlds of a job."""
    if isinstance(worlds, DeviatedWorlds):
        within = opened(worlds.within)
        assert not isinstance(within, DeviatedEpisodes)
        return DeviatedEpisodes(within, dict(enumerate(worlds.cases)))
    if isinstance(worlds, TaskWorld):
        return TaskEpisodes(read_task(worlds.task), worlds)
    # Task sets need much that a task does not; the server imports it in advance.
    from tdac_agent.verification.judge.set_worlds import open_set

    return open_set(worlds)


def judge_episodes(
    job: EpisodeJob, child_pool: ChildPool, series: Drive | None = None
) -> None:
    """Drives the episodes of a job, and writes a row for each in their order.

    A sequential test gets them in the same order, so that its decision does not depend
    on timing. Episodes after its decision are dropped.

    Args:
        job: The job.
        child_pool: The child pool.
        series: Who drives the episodes if the job is one of a series.
    """
    job.out.mkdir(exist_ok=True)
    counts, fault, problem = [0, 0, 0], None, None
    tier = job.tier if job.policy.kind == "controller" else UNSANDBOXED
    before = kept_rows(job.rows, job.numbers)
    with ExitStack() as stack:
        paths = [job.out / EPISODES_FILE, *([job.rows] if job.rows else [])]
        files = [
            stack.enter_context(path.open("a", encoding="utf-8")) for path in paths
        ]
        files[0].writelines(f"{each.model_dump_json()}\n" for each in before)
        files[0].flush()
        try:
            if series is not None:
                episodes = series(job)
            else:
                run = EpisodeRun.of(job, child_pool)
                numbers = job.numbers[len(before) :]
                if job.checks:
                    checks, tier = _checked(run)
                    write_atomic(job.out / CHECKS_FILE, checks.model_dump_json())
                    numbers = () if checks.failures else numbers
                late = sum(each.cause == "time-out" for each in before)
                episodes = _in_order(run, numbers, late)
            for done in episodes:
                tier = done.tier or tier
                for file in files:
                    file.write(done.row.model_dump_json() + "\n")
                    file.flush()
                counts[not done.row.success] += 1
                counts[2] += done.row.touched
                if job.test and job.test.decide(*counts) != "undecided":
                    break
        except SandboxError as error:
            fault = error.fault
        except TaskError as error:  # there is no feasible world
            problem = str(error)
    ending = JobEnding(tier=tier, fault=fault, problem=problem)
    write_atomic(job.out / ENDING_FILE, ending.model_dump_json())


def kept_rows(path: Path | None, numbers: tuple[int, ...]) -> list[EpisodeRow]:
    """The first of these episodes that an interrupted job has kept.

    A line that was not written completely ends them. The file is cut off before it.

    Args:
        path: The file; None for none.
        numbers: Numbers of the episodes, in their order.
    """
    found: list[EpisodeRow] = []
    if path is None or not path.is_file():
        return found
    text = read_file(path, MOST_ROW_BYTES)
    size = 0
    for line in text.splitlines(keepends=True):
        if len(found) == len(numbers) or not line.endswith(b"\n"):
            break
        row = EpisodeRow.model_validate_json(line)
        if row.number != numbers[len(found)]:
            break
        found.append(row)
        size += len(line)
    if size < len(text):
        write_atomic(path, text[:size])
    return found


def drive_number(run: EpisodeRun, number: int) -> Driven:
    """Drives an episode; a controller runs in a fresh child, told nothing of it."""
    rollout, env, cpu_seconds, tier = _drive(run, number)
    told = run.job.told
    row = row_of(run.worlds, number, rollout, env, cpu_seconds, told=told)
    return Driven(rollout, row, tier)


def _checked(run: EpisodeRun) -> tuple[Checks, str]:
    """The static tests, and the first steps on a public world; also the tier."""
    results, job, worlds = static_checks(run.program.source), run.job, run.worlds
    if len(results) == 1:  # it does not parse
        return Checks(results=results), job.tier
    assert not isinstance(worlds, TaskEpisodes | DeviatedEpisodes)
    # A public world, so that a failure tells nothing of hidden ones.
    own = worlds.worlds
    split = public_split(worlds.tasks) or own.split
    shown = own.model_copy(update={"split": split, "salt_file": None})
    # Here and not in a worker pool, so that its processes share what this loads.
    drive = partial(_drive, replace(run, worlds=opened(shown)), 0, CHECKED_STEPS)
    rollout, _, _, tier = drive()
    if rollout.is_retryable:
        rollout, _, _, tier = drive()
    return Checks(results={**results, STABLE: rollout.error}), tier


def _in_order(
    run: EpisodeRun, numbers: Sequence[int], late: int
) -> Generator[EpisodeSummary]:
    if numbers:
        if run.job.policy.kind != "controller":
            from tdac_agent.verification.judge.drivers import load

            load(run.job.policy)
        work, end = partial(drive_or_skip, run), run.child_pool.close
        with closing(in_order(work, end, numbers, late, run.job.patience)) as episodes:
            yield from episodes


def drive_or_skip(run: EpisodeRun, number: int, skip: bool) -> EpisodeSummary:
    """Drives or skips an episode, and returns what is kept of it."""
    job = run.job
    if job.policy.kind == "privileged":
        assert not isinstance(run.worlds, TaskEpisodes | DeviatedEpisodes)
        row = run.worlds.planned(number)
        return EpisodeSummary(row, UNSANDBOXED, late=False, is_retryable=False)
    driven = _skipped(run, number) if skip else drive_number(run, number)
    rollout = driven.rollout
    if job.trajectories is not None:
        job.trajectories.mkdir(parents=True, exist_ok=True)
        rollout.trajectory.save(job.trajectories / f"{number}.npz", rollout.calls)
    late = rollout.outcome == "error" and rollout.timed_out
    return EpisodeSummary(driven.row, driven.tier, late, rollout.is_retryable)


def _skipped(run: EpisodeRun, number: int) -> Driven:
    reason = f"not driven, because {run.job.patience} earlier episodes timed out"
    record = run.worlds.record(number)
    fault = ControllerFault(reason, "policy")
    rollout = not_driven(record, run.worlds.name(number), fault)
    row = row_of(run.worlds, number, rollout, record.env, 0.0, told=run.job.told)
    return Driven(rollout, row, "")


def _drive(
    run: EpisodeRun, number: int, most: int = FOREVER
) -> tuple[Rollout, JudgedEnv, float, str]:
    """Drives at most `most` steps; fewer than an episode are not budgeted.

    Returns:
        The episode, its environment, the CPU time of the policy, s, and the tier.
    """
    worlds, policy = run.worlds, run.job.policy
    record, name = worlds.record(number, most), worlds.name(number)
    # Single calls and their mean time are limited instead of the episode.
    drive = partial(
        run_policy, record=record, name=name, held_out=False, deadline=math.inf
    )
    if policy.kind != "controller":
        # Wrappers and guidance, which controllers do without.
        from tdac_agent.verification.judge.drivers import driver_of

        began = time.process_time()
        try:
            rollout = drive(driver_of(policy, plain_env(record.env), number))
        except ControllerFault as fault:
            rollout = not_driven(record, name, fault)
        return rollout, record.env, time.process_time() - began, UNSANDBOXED
    record.seen = worlds.seen
    child = run.child_pool.take(run.job.tier, run.job.limits)
    try:
        worlds.supply(child, number, run.program)
        rollout = drive(worlds.load(child) if most == FOREVER else _loaded(child))
    except ControllerFault as fault:
        rollout = not_driven(record, name, fault)
    finally:
        usage = child.close()
    rollout = replace(rollout, printed=usage.printed)
    return rollout, record.env, usage.cpu_seconds, child.tier


def _loaded(child: Child) -> Driver:
    child.load()
    return child


def row_of(
    worlds: Worlds,
    number: int,
    rollout: Rollout,
    env: JudgedEnv,
    cpu_seconds: float,
    *,
    told: bool = True,
) -> EpisodeRow:
    """The row of an episode that has just been driven in an environment."""
    task, shown = worlds.diagnosed(env)
    return driven_row(
        rollout,
        task,
        worlds.facts(env, number),
        units=worlds.units,
        shown=shown,
        told=told,
        cpu_seconds=cpu_seconds,
    )
