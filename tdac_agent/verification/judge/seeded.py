"""Runs many episodes by seed in the judge's process, and stores their results."""

from __future__ import annotations

import math
from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from tdac_agent.episodes.episode import not_driven
from tdac_agent.episodes.trajectory import Outcome, Trajectory
from tdac_agent.sandbox import ControllerFault, Limits, SandboxError
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.printable_record import PrintableRecord
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.task import Task, read_task
from tdac_agent.verification.diagnosis.diagnosis import diagnose
from tdac_agent.verification.diagnosis.measures import (
    Measured,
    least_steps,
    measure,
)
from tdac_agent.verification.diagnosis.report import Cause, Diagnosis
from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.drivers import PolicySpec
from tdac_agent.verification.judge.driving import (
    EpisodeSetup,
    SeededResult,
    drive_seed,
    record_of,
)
from tdac_agent.verification.judge.in_order import in_order
from tdac_agent.verification.judge.kept_episodes import KeptEpisode, keep_episode
from tdac_agent.verification.judge.sequential import SequentialTest
from tdac_envs.ladder.scores import time_score

EPISODES_FILE, ENDING_FILE = "episodes.jsonl", "ending.json"
# In an evaluation, the remaining episodes are skipped after this many time-outs.
MOST_LATE = 3
SCORE_DIGITS = 6


class SeededJob(BaseModel):
    """Episodes to run; all paths are absolute.

    `test` stops a robust verification early. `keep` is the folder of an evaluation,
    which keeps measures instead of a diagnosis, and poses and call times as well;
    `late` is the number of time-outs among its episodes that were run before. With
    `failures`, episodes are scored, and it is the folder for the trajectories of those
    that fail, `SEED.npz`.
    """

    model_config = ConfigDict(extra="forbid")

    kind: Literal["seeds"] = "seeds"
    task: Path
    policy: PolicySpec
    disturbance: Disturbance
    variation: str
    seeds: tuple[int, ...]
    test: SequentialTest | None
    keep: Path | None = None
    late: int = 0
    failures: Path | None = None
    tier: str
    limits: Limits
    out: Path


class SeededEpisode(PrintableRecord):
    """Figures of one disturbed episode; distances in px, for the e-puck in m.

    `cause`, `step`, `x`, `y` and `side` are the diagnosis of a failure.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    seed: int
    outcome: Outcome
    steps: int
    collisions: int
    d0: float
    d_min: float
    cause: Cause | None = None
    step: int | None = None
    x: float | None = None
    y: float | None = None
    side: str | None = None
    error: str | None = None
    cpu_seconds: float

    @property
    def success(self) -> bool:
        """Whether the goal was reached without contact."""
        return self.outcome == "reached" and not self.collisions


class ScoredEpisode(SeededEpisode):
    """The figures with scores, and the whole diagnosis of a failure."""

    time_score: float = Field(description="Success weighted by completion time, SCT.")
    clearance: float = Field(
        description="Least gap between body and obstacles, px or m; 0 after a failure."
    )
    diagnosis: Diagnosis | None = None


class JobEnding(PrintableRecord):
    """What the judge's process found in addition to the episodes.

    `fault` is why the sandbox failed, `problem` what is wrong with the task.
    """

    model_config = ConfigDict(extra="forbid")

    tier: str
    fault: str | None = None
    problem: str | None = None


NO_MOVERS = np.zeros((0, 0, 3), np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class EpisodeSummary:
    """What is kept of an episode.

    Attributes:
        figures: A line of the results.
        tier: Sandbox tier; empty if nothing was started.
        late: Whether the controller timed out.
        is_retryable: Whether the time-out may be due to a busy machine.
        poses: Poses of an evaluation, shape (T + 1, 3), float32; else empty.
        calls: Call times of an evaluation, s, shape (T,), float32; else empty.
    """

    figures: SeededEpisode | Measured
    tier: str
    late: bool
    is_retryable: bool
    poses: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 3), "f4"))
    calls: NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, "f4"))
    movers: NDArray[np.float32] = field(default_factory=lambda: NO_MOVERS)


def judge_seeds(job: SeededJob, child_pool: ChildPool) -> None:
    """Runs the episodes of a job, and writes a line for each in the order of seeds.

    A sequential test gets them in the same order, so that its decision does not depend
    on timing. Episodes after its decision are dropped.
    """
    job.out.mkdir(exist_ok=True)
    setup = EpisodeSetup(
        read_task(job.task),
        job.policy,
        job.task,
        job.disturbance,
        job.tier,
        job.limits,
        child_pool,
        job.variation,
    )
    counts, tier, fault = [0, 0], job.tier, None
    with (job.out / EPISODES_FILE).open("w", encoding="utf-8") as file:
        try:
            with closing(_in_order(setup, job)) as episodes:
                for kept in episodes:
                    tier = kept.tier or tier
                    if job.keep is not None and isinstance(kept.figures, Measured):
                        keep_episode(job.keep, _lasting(kept, kept.figures))
                    file.write(kept.figures.model_dump_json() + "\n")
                    file.flush()
                    counts[not kept.figures.success] += 1
                    if job.test and job.test.decide(*counts) != "undecided":
                        break
        except SandboxError as error:
            fault = error.fault
    ending = JobEnding(tier=tier, fault=fault)
    write_atomic(job.out / ENDING_FILE, ending.model_dump_json())


def _lasting(kept: EpisodeSummary, figures: Measured) -> KeptEpisode:
    return KeptEpisode(
        figures, kept.tier, kept.late, kept.poses, kept.calls, kept.movers
    )


def _in_order(setup: EpisodeSetup, job: SeededJob) -> Generator[EpisodeSummary]:
    work = partial(_run_episode, setup, job.keep is not None, job.failures)
    patience = None if job.keep is None else MOST_LATE
    return in_order(work, setup.child_pool.close, job.seeds, job.late, patience)


def _run_episode(
    setup: EpisodeSetup, measured: bool, failures: Path | None, seed: int, skip: bool
) -> EpisodeSummary:
    """Drives or skips the episode of a seed, and returns what is kept of it."""
    driven = _skipped(setup, seed) if skip else drive_seed(setup, seed)
    rollout = driven.rollout
    late = rollout.outcome == "error" and rollout.timed_out
    if failures is not None:
        scored = _scored(driven, seed, setup.task, failures)
        return EpisodeSummary(scored, driven.tier, late, rollout.is_retryable)
    if not measured:
        found = figures(driven, seed, setup.task)
        return EpisodeSummary(found, driven.tier, late, rollout.is_retryable)
    return EpisodeSummary(
        measure(rollout, seed, driven.task),
        driven.tier,
        late,
        rollout.is_retryable,
        rollout.trajectory.poses.astype(np.float32),
        rollout.calls.astype(np.float32),
        _last_movers(rollout.trajectory),
    )


def _last_movers(trajectory: Trajectory) -> NDArray[np.float32]:
    """Moving obstacles in the last steps, shape (t, n, 3)."""
    ghosts = trajectory.ghosts(trajectory.steps)
    return np.array(ghosts, np.float32) if ghosts else NO_MOVERS


def _skipped(setup: EpisodeSetup, seed: int) -> SeededResult:
    reason = f"not driven, because {MOST_LATE} earlier episodes timed out"
    record = record_of(setup, seed)
    rollout = not_driven(record, f"seed {seed}", ControllerFault(reason, "policy"))
    return SeededResult(rollout, 0.0, "", record.env.task)


def figures(driven: SeededResult, seed: int, task: Task) -> SeededEpisode:
    """Figures of an episode, with the diagnosis of a failure."""
    found = _diagnosis_of(driven, task)
    return SeededEpisode(**_facts(driven, seed, task, found))


def _scored(
    driven: SeededResult, seed: int, task: Task, failures: Path
) -> ScoredEpisode:
    """The figures with scores; keeps the trajectory of a failure."""
    rollout, found = driven.rollout, _diagnosis_of(driven, task)
    room = float(rollout.rooms.min(initial=math.inf)) - rollout.radius
    score = 0.0
    if found is None:
        steps = rollout.trajectory.steps
        score = time_score(True, steps, least_steps(driven.task))
    elif rollout.trajectory.steps:
        failures.mkdir(parents=True, exist_ok=True)
        rollout.trajectory.save(failures / f"{seed}.npz")
    return ScoredEpisode(
        **_facts(driven, seed, task, found),
        time_score=round(score, SCORE_DIGITS),
        clearance=0.0 if found else round(max(room, 0.0), task.setting.units.digits),
        diagnosis=found,
    )


def _diagnosis_of(driven: SeededResult, task: Task) -> Diagnosis | None:
    """What happened in a failed episode; None for a success."""
    rollout = driven.rollout
    if rollout.reached and not rollout.collisions:
        return None
    return diagnose(rollout, task.nominal)


def _facts(
    driven: SeededResult, seed: int, task: Task, found: Diagnosis | None
) -> dict[str, Any]:
    """The fields of a `SeededEpisode`."""
    rollout, failure = driven.rollout, {}
    distances, digits = rollout.distances(), task.setting.units.digits
    if found is not None:
        failure = found.model_dump(include={"cause", "step", "x", "y", "side"})
    return {
        "seed": seed,
        "outcome": rollout.outcome,
        "steps": rollout.trajectory.steps,
        "collisions": rollout.collisions,
        "d0": round(float(distances[0]), digits),
        "d_min": round(float(distances.min()), digits),
        "error": rollout.error,
        "cpu_seconds": round(driven.cpu_seconds, 3),
        **failure,
    }
