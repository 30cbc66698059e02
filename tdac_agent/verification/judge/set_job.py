"""Drives a controller on worlds of a task set in the judge's process."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Generator
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict

from tdac_agent.episodes.episode import Driver, Record, not_driven, run_policy
from tdac_agent.episodes.trajectory import Contact, Outcome, Rollout
from tdac_agent.sandbox import Child, ControllerFault, Limits, SandboxError
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.printable_record import PrintableRecord
from tdac_agent.tasks.start_frame import StartFrame
from tdac_agent.tasks.units import UNITS, Units
from tdac_agent.verification.diagnosis.diagnosis import diagnose
from tdac_agent.verification.diagnosis.report import Cause
from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.cpu_budget import Budgeted
from tdac_agent.verification.judge.driving import FOREVER
from tdac_agent.verification.judge.in_order import in_order
from tdac_agent.verification.judge.seeded import (
    ENDING_FILE,
    EPISODES_FILE,
    JobEnding,
)
from tdac_agent.verification.judge.sequential import SequentialTest
from tdac_agent.verification.judge.set_checks import (
    CHECKED_STEPS,
    CHECKS_FILE,
    STABLE,
    Checks,
    static_checks,
)
from tdac_agent.verification.judge.set_files import write_files
from tdac_envs.core.errors import TaskError
from tdac_envs.core.intake import RECORD_BYTES, read_file
from tdac_envs.ladder.env import TaskSetEnv, make
from tdac_envs.ladder.scores import barn_score, path_score, time_score
from tdac_envs.ladder.set_file import SetFile
from tdac_envs.ladder.task_sets import AnyTask, AnyWorld
from tdac_envs.map2d.task import Map2DTask
from tdac_envs.movers.state import SPEED


class SetJob(BaseModel):
    """Worlds to drive on; all paths are absolute.

    `test` stops early. `per_world` is whether episodes may have a diagnosis. In `kept`,
    without a test, an interrupted job finds the episodes that it has driven already.
    """

    model_config = ConfigDict(extra="forbid")

    kind: Literal["set"] = "set"
    set_file: Path
    split: str
    salt_file: Path | None
    worlds: tuple[int, ...]
    controller: Path
    test: SequentialTest | None
    per_world: bool
    tier: str
    limits: Limits
    out: Path
    trajectories: Path | None = None
    hidden_folder: Path | None = None
    kept: Path | None = None


class WorldEpisode(PrintableRecord):
    """Figures of an episode on a world; lengths in px or m.

    `length` to `mover_speed` describe the world; `least_steps` is OT, and `mover_speed`
    the mean speed of its movers as a part of the robot's. `cause` and `text` are the
    diagnosis of a failure; the text only if it may be told. `contact` is what was
    touched in a collision.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    index: int
    generator: str
    outcome: Outcome
    steps: int
    horizon: int
    time_score: float
    path_score: float
    barn_score: float
    d_min: float
    length: float
    least_steps: float
    gap: float
    detour: float
    in_sight: float
    density: float
    movers: int = 0
    mover_speed: float = 0.0
    contact: Contact | None = None
    cause: Cause | None = None
    text: str | None = None
    error: str | None = None
    cpu_seconds: float

    @property
    def success(self) -> bool:
        """Whether the goal was reached without contact."""
        return self.outcome == "reached"


@dataclass(frozen=True, slots=True)
class WorldSummary:
    """What is kept of an episode; see `in_order.Timed`."""

    figures: WorldEpisode
    tier: str
    late: bool
    is_retryable: bool


def kept_worlds(path: Path | None, worlds: tuple[int, ...]) -> list[WorldEpisode]:
    """The first episodes of these worlds that an interrupted job has kept.

    A line that was not written completely ends them. Its file is cut off before it.

    Args:
        path: The file; None for none.
        worlds: Numbers of the worlds, in their order.
    """
    found: list[WorldEpisode] = []
    if path is None or not path.is_file():
        return found
    text = path.read_bytes()
    size = 0
    for line in text.splitlines(keepends=True):
        if len(found) == len(worlds) or not line.endswith(b"\n"):
            break
        episode = WorldEpisode.model_validate_json(line)
        if episode.index != worlds[len(found)]:
            break
        found.append(episode)
        size += len(line)
    if size < len(text):
        write_atomic(path, text[:size])
    return found


@dataclass(eq=False)
class SetRun:
    """Everything that the episodes of a job share.

    Attributes:
        job: The job.
        source: Bytes of the controller.
        child_pool: The child pool.
    """

    job: SetJob
    source: bytes
    child_pool: ChildPool

    @cached_property
    def env(self) -> TaskSetEnv:
        """The environment, with complete infos for the judge."""
        job, folder = self.job, self.job.hidden_folder
        return make(
            job.set_file,
            split=job.split,
            train_pool=0,
            salt_file=job.salt_file,
            privileged=True,
            **({} if folder is None else {"hidden_folder": folder}),
        )

    @property
    def file(self) -> SetFile:
        """The task set."""
        return self.env.set.file

    def budgeted(self, child: Child) -> Driver:
        """Imports the controller in a child whose CPU time is limited."""
        driver = Budgeted(child, self.file.cpu)
        driver.load()
        return driver


def judge_set(job: SetJob, child_pool: ChildPool) -> None:
    """Runs the tests, and if they pass the episodes, with a line for each in order."""
    job.out.mkdir(exist_ok=True)
    run = SetRun(job, read_file(job.controller, RECORD_BYTES), child_pool)
    counts, tier, fault, problem = [0, 0], job.tier, None, None
    before = kept_worlds(job.kept, job.worlds)
    with ExitStack() as stack:
        paths = [job.out / EPISODES_FILE, *([job.kept] if job.kept else [])]
        files = [
            stack.enter_context(path.open("a", encoding="utf-8")) for path in paths
        ]
        files[0].writelines(f"{each.model_dump_json()}\n" for each in before)
        files[0].flush()
        try:
            checks, tier = _checked(run)
            write_atomic(job.out / CHECKS_FILE, checks.model_dump_json())
            worlds = () if checks.failures else job.worlds[len(before) :]
            for driven in _episodes(run, worlds):
                tier = driven.tier or tier
                for file in files:
                    file.write(driven.figures.model_dump_json() + "\n")
                    file.flush()
                counts[not driven.figures.success] += 1
                if job.test and job.test.decide(*counts) != "undecided":
                    break
        except SandboxError as error:
            fault = error.fault
        except TaskError as error:  # there is no feasible world
            problem = str(error)
    ending = JobEnding(tier=tier, fault=fault, problem=problem)
    write_atomic(job.out / ENDING_FILE, ending.model_dump_json())


def _checked(run: SetRun) -> tuple[Checks, str]:
    """The static tests, and the first steps on a public world; also the tier."""
    results, job = static_checks(run.source), run.job
    if len(results) == 1:  # it does not parse
        return Checks(results=results), job.tier
    # A public world, so that a failure tells nothing of hidden ones.
    public = ("dev", "test", "train")
    split = next((each for each in public if run.env.set.count(each) != 0), job.split)
    shown = job.model_copy(update={"split": split, "salt_file": None})
    # Here and not in a worker pool, so that its processes share what this loads.
    drive = partial(_driven, replace(run, job=shown), 0, CHECKED_STEPS, _loaded)
    rollout, _, tier = drive()
    if rollout.is_retryable:
        rollout, _, tier = drive()
    return Checks(results={**results, STABLE: rollout.error}), tier


def _episodes(run: SetRun, worlds: tuple[int, ...]) -> Generator[WorldSummary]:
    if worlds:
        work = partial(drive_world, run)
        with closing(in_order(work, run.child_pool.close, worlds)) as episodes:
            yield from episodes


def drive_world(run: SetRun, index: int, skip: bool) -> WorldSummary:  # noqa: ARG001
    """Drives the episode of a world, in a fresh child that is told nothing of it."""
    rollout, cpu_seconds, tier = drive_once(run, index)
    late = rollout.outcome == "error" and rollout.timed_out
    job = run.job
    figures = figures_of(
        run.env, job.split, index, rollout, cpu_seconds, per_world=job.per_world
    )
    if run.job.trajectories is not None:
        run.job.trajectories.mkdir(parents=True, exist_ok=True)
        rollout.trajectory.save(run.job.trajectories / f"{index}.npz")
    return WorldSummary(figures, tier, late, rollout.is_retryable)


def drive_once(run: SetRun, index: int) -> tuple[Rollout, float, str]:
    """Drives the episode of a world within the CPU budget.

    Returns:
        The episode, the CPU time of the controller, s, and the sandbox tier.
    """
    return _driven(run, index, FOREVER, run.budgeted)


def _driven(
    run: SetRun, index: int, most: int, load: Callable[[Child], Driver]
) -> tuple[Rollout, float, str]:
    """Drives at most `most` steps; returns also the CPU time, s, and the tier.

    `load` imports the controller.
    """
    # The judge's own copy of the task, so that the files can be written before.
    task, name = run.env.setup.source.task(index), f"world {index}"
    record = Record(run.env, None, most, options={"index": index})
    child = run.child_pool.take(run.job.tier, run.job.limits)
    try:
        supply(child, run, task)
        driver = load(child)
        rollout = run_policy(driver, record, name, held_out=False, deadline=math.inf)
    except ControllerFault as fault:
        rollout = not_driven(record, name, fault)
        rollout = replace(rollout, is_retryable=fault.is_retryable)
    finally:
        usage = child.close()
    return rollout, usage.cpu_seconds, child.tier


def supply(child: Child, run: SetRun, task: AnyTask) -> None:
    """Gives a child the files of an episode: all that it is told.

    Raises:
        ControllerFault: The controller is too large.
    """
    with tempfile.TemporaryDirectory() as name:
        write_files(Path(name), run.file, task)
        child.copy_files(Path(name), run.source)


def _loaded(child: Child) -> Driver:
    child.load()
    return child


def figures_of(
    env: TaskSetEnv,
    split: str,
    index: int,
    rollout: Rollout,
    cpu_seconds: float,
    *,
    per_world: bool,
) -> WorldEpisode:
    """The figures of an episode that has just been driven.

    Args:
        env: The environment in which it was driven.
        split: Split of its world.
        index: Number of its world.
        rollout: The episode.
        cpu_seconds: CPU time of the policy, s.
        per_world: Whether it may have a diagnosis.
    """
    world = env.setup.source.world(index)
    hard = world.difficulty
    barn_steps = world.barn_steps or hard.length / env.set.file.full_step
    steps = rollout.trajectory.steps
    places = rollout.trajectory.poses[:, :2]
    driven = float(np.hypot(*np.diff(places, axis=0).T).sum())
    reached, failure = rollout.reached, {}
    if not reached:
        found = diagnose(rollout, env.task, shown_units(env.set.file, env.task))
        failure = {"cause": found.cause, "text": found.text if per_world else None}
    return WorldEpisode(
        index=index,
        generator=env.set.kind(split, index),
        outcome=rollout.outcome,
        steps=steps,
        horizon=env.task.horizon,
        time_score=time_score(reached, steps, hard.steps),
        path_score=path_score(reached, driven, hard.length),
        barn_score=barn_score(reached, steps, barn_steps),
        d_min=round(float(rollout.distances().min()), UNITS[env.set.file.unit].digits),
        **figures_of_world(world, env.task),
        contact=rollout.contact,
        error=rollout.error,
        cpu_seconds=round(cpu_seconds, 3),
        **failure,
    )


def figures_of_world(world: AnyWorld, task: AnyTask) -> dict[str, Any]:
    """The figures of `WorldEpisode` that describe a world, with its movers."""
    hard = world.difficulty
    return {
        "length": hard.length,
        "least_steps": hard.steps,
        "gap": hard.gap,
        "detour": hard.detour,
        "in_sight": hard.in_sight,
        "density": hard.density,
        **movers_of(task),
    }


def movers_of(task: AnyTask) -> dict[str, Any]:
    """`movers` and `mover_speed` of a world; empty without movers."""
    movers = task.movers if isinstance(task, Map2DTask) else None
    if movers is None or not len(movers.traits):
        return {}
    speed = float(movers.traits[:, SPEED].mean()) * task.dt / task.full_step
    return {"movers": len(movers.traits), "mover_speed": round(speed, 4)}


def shown_units(file: SetFile, task: AnyTask) -> Units:
    """Units of diagnoses, in the frame that the policy observes.

    Args:
        file: The task set.
        task: The task of a world.
    """
    units = UNITS[file.unit]
    if file.frame == "map":
        return units
    return units.from_start(StartFrame.of(task.start, units))
