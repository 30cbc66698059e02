"""Disturbed episodes by seed, in the judge's process; what is kept of each."""

from __future__ import annotations

import math
from collections.abc import Generator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from pydantic import BaseModel, ConfigDict

from tdac_agent.crew import SIZE, Crew
from tdac_agent.diagnosis import diagnose
from tdac_agent.disturbance import Disturbance
from tdac_agent.episode import Record, not_driven, run_policy
from tdac_agent.files import write_atomic
from tdac_agent.nursery import Nursery
from tdac_agent.report import Cause
from tdac_agent.sandbox import ControllerFault, Limits, SandboxError
from tdac_agent.sequential import SequentialTest
from tdac_agent.task import Task, load_task
from tdac_agent.trajectory import Outcome, Rollout
from tdac_agent.turns import Turns

EPISODES_FILE, ENDING_FILE = "episodes.jsonl", "ending.json"


class SeededJob(BaseModel):
    """Episodes that the judge's process is to run; all paths are absolute."""

    model_config = ConfigDict(extra="forbid")

    task: Path
    controller: Path
    disturbance: Disturbance
    first_seed: int
    episodes: int
    test: SequentialTest | None
    tier: str
    limits: Limits
    out: Path


class SeededEpisode(BaseModel):
    """Figures of one disturbed episode; distances in px, of the e-puck in m.

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
        """Whether the goal was reached without a contact."""
        return self.outcome == "reached" and not self.collisions


class Ending(BaseModel):
    """What the judge's process found beside the episodes."""

    model_config = ConfigDict(extra="forbid")

    tier: str
    fault: str | None = None


@dataclass(frozen=True, slots=True)
class Stage:
    """All that an episode depends on but its seed.

    Attributes:
        task: What the controller must do.
        source: Bytes of `controller.py`.
        workdir: Folder whose files the controller may read.
        disturbance: Of the environment.
        tier: Sandbox tier, or `auto`.
        limits: Of each child, and so of each episode.
        nursery: Where children come from.
    """

    task: Task
    source: bytes
    workdir: Path
    disturbance: Disturbance
    tier: str
    limits: Limits
    nursery: Nursery


@dataclass(frozen=True, slots=True, eq=False)
class Driven:
    """An episode, the CPU seconds of its child, and the sandbox tier of that."""

    rollout: Rollout
    cpu_seconds: float
    tier: str


def drive_seed(stage: Stage, seed: int) -> Driven:
    """The episode of a seed, in a fresh child.

    Start and noise are what the environment draws after `reset(seed=seed)`.
    """
    env = stage.task.disturbed_env(stage.disturbance)
    record = Record(env, None, stage.task.nominal.horizon, seed=seed)
    name = f"seed {seed}"
    child = stage.nursery.take(stage.tier, stage.limits)
    try:
        child.furnish(stage.workdir, stage.source)
        child.load()
        # Each call has its limit, and slow ones are cut off by their mean.
        rollout = run_policy(child, record, name, held_out=False, deadline=math.inf)
    except ControllerFault as fault:
        rollout = not_driven(record, name, fault)
    finally:
        usage = child.close()
    return Driven(rollout, usage.cpu_seconds, child.tier)


def judge_seeds(job: SeededJob, nursery: Nursery) -> None:
    """Runs the episodes as asked, and writes a line for each in the order of seeds.

    A sequential test sees them in this order, too, and so decides the same however
    they happen to end; those after its decision are dropped.
    """
    job.out.mkdir(exist_ok=True)
    stage = Stage(
        load_task(job.task),
        job.controller.read_bytes(),
        job.task,
        job.disturbance,
        job.tier,
        job.limits,
        nursery,
    )
    counts, tier, fault = [0, 0], job.tier, None
    with (job.out / EPISODES_FILE).open("w", encoding="utf-8") as file:
        try:
            with closing(_in_order(stage, job)) as episodes:
                for episode, tier in episodes:  # noqa: B007
                    file.write(episode.model_dump_json() + "\n")
                    file.flush()
                    counts[not episode.success] += 1
                    if job.test and job.test.decide(*counts) != "undecided":
                        break
        except SandboxError as error:
            fault = f"the sandbox failed: {error}"
    ending = Ending(tier=tier, fault=fault)
    write_atomic(job.out / ENDING_FILE, ending.model_dump_json())


def _in_order(stage: Stage, job: SeededJob) -> Generator[tuple[SeededEpisode, str]]:
    """Episodes and their tiers, several at a time; closing waits for the last."""
    seeds = range(job.first_seed, job.first_seed + job.episodes)
    size = min(SIZE, job.episodes)
    turns = Turns(size)
    with (
        closing(Crew(partial(_driven, stage), stage.nursery.close, size)) as crew,
        ThreadPoolExecutor(max_workers=size) as pool,
    ):
        try:
            yield from pool.map(partial(_in_turn, crew, turns), seeds)
        finally:
            pool.shutdown(cancel_futures=True)


def _driven(stage: Stage, seed: int) -> tuple[SeededEpisode, str, bool]:
    """What is kept of an episode, its tier, and whether it took too long."""
    driven = drive_seed(stage, seed)
    rollout = driven.rollout
    late = rollout.outcome == "error" and rollout.timed_out
    return figures(driven, seed, stage.task), driven.tier, late


def _in_turn(
    crew: Crew[[int], tuple[SeededEpisode, str, bool]], turns: Turns, seed: int
) -> tuple[SeededEpisode, str]:
    """An episode and its tier.

    A time-out may be the machine's doing, so it is tried once more, alone.
    """
    with turns.beside():
        episode, tier, late = crew.do(seed)
    if late:
        with turns.alone():
            episode, tier, _ = crew.do(seed)
    return episode, tier


def figures(driven: Driven, seed: int, task: Task) -> SeededEpisode:
    """What is kept of an episode; its trajectory is not."""
    rollout, failure = driven.rollout, {}
    distances, digits = rollout.distances(), task.setting.units.digits
    if not rollout.reached or rollout.collisions:
        found = diagnose(rollout, task.nominal)
        failure = found.model_dump(include={"cause", "step", "x", "y", "side"})
    return SeededEpisode(
        seed=seed,
        outcome=rollout.outcome,
        steps=rollout.trajectory.steps,
        collisions=rollout.collisions,
        d0=round(float(distances[0]), digits),
        d_min=round(float(distances.min()), digits),
        error=rollout.error,
        cpu_seconds=round(driven.cpu_seconds, 3),
        **failure,
    )
