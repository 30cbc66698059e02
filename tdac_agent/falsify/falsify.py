"""Searches for the smallest deviation with which a policy fails, and writes it down."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tdac_agent.falsify.drives import JITTER, Drives, Searched
from tdac_agent.falsify.search import Search, near
from tdac_agent.problems.episodes import check_physics
from tdac_agent.runs.falsification import (
    RECORD_FILE,
    Envelope,
    Falsification,
    Point,
)
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.links import refuse_links
from tdac_agent.tasks.deviation import (
    DEVIATIONS,
    MOST,
    Deviation,
    limit_of,
    space_of,
)
from tdac_agent.tasks.provenance import versions
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.units import frame_of
from tdac_agent.verification.judge.set_worlds import printed_units
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.judge.worlds import Case
from tdac_agent.verification.store import UNFINISHED
from tdac_envs.core.arguments import one_of, whole_number
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.task_sets import TaskSet
from tdac_envs.physics.moved import EXACT

EPISODES, WORLDS = 256, 4
LEAST, MOST_EPISODES = 16, 1_000_000
SPLITS = ("dev", "test")
START = "start_x", "start_y", "heading"
Watch = Callable[[int], None]


@dataclass(frozen=True, slots=True)
class SearchPlan:
    """What is searched, and how much.

    Attributes:
        episodes: Most episodes of the search.
        seed: Seed of the search, and of the episodes of a task.
        space: Parts to search alone, each with its size or None for the usual one;
            None for all parts that the problem has.
        split: Split of a set.
        worlds: Number of worlds of a set, from the first one; they share the episodes.
        chosen: Numbers of worlds of a set, instead of the first ones.
        curves: Jittered starts, or worlds, at each point of the curves of success; 0
            for none. These episodes come on top.
        physics: What moves the robot.
    """

    episodes: int = EPISODES
    seed: int = 0
    space: Mapping[str, float | None] | None = None
    split: str = "dev"
    worlds: int = WORLDS
    chosen: tuple[int, ...] = ()
    curves: int = 0
    physics: str = EXACT

    def __post_init__(self) -> None:
        whole_number("episodes", self.episodes, LEAST, MOST_EPISODES)
        whole_number("seed", self.seed, 0)
        whole_number("worlds", self.worlds, 1)
        whole_number("curves", self.curves, 0)
        one_of("split", self.split, SPLITS)


def falsify(
    entrant: Searched,
    problem: Task | TaskSet,
    plan: SearchPlan | None = None,
    *,
    tier: str = "auto",
    out: Path | None = None,
    judge: WarmJudge | None = None,
    watch: Watch | None = None,
    finish: Callable[[Falsification], None] | None = None,
) -> Falsification:
    """Searches for the smallest deviation with which a policy fails.

    The same seed gives the same result, if the policy is deterministic. What an
    interrupted search has driven is taken from `out` by the next one.

    Args:
        entrant: The policy; of those in `evaluation.policies`, one that is `fitted`
            and `prepared`.
        problem: A task; or a task set, on whose worlds start and obstacles stay.
        plan: What is searched.
        tier: Sandbox tier.
        out: Folder for `falsify.json`.
        judge: A warm judge; None starts one for this call.
        watch: Called with the number of episodes so far.
        finish: Called with the record, while what was driven is still kept in `out`:
            an interruption loses nothing.

    Raises:
        TaskError: The policy does not drive there, or the plan is not valid there.
        Fault: The sandbox is broken.
        RunError: A link leads out of `out`.
    """
    plan = plan or SearchPlan()
    if out is not None:
        refuse_links(out, RECORD_FILE, UNFINISHED)
    space = space_on(problem, plan)
    numbers = _numbers(problem, plan)
    steps = steps_on(problem, space)
    points = _points(space, steps) if plan.curves else []
    whole = plan.episodes + plan.curves * len(points)
    check_physics(problem, plan.physics)
    about: dict[str, Any] = {"seed": plan.seed, "kind": "falsify"}
    if judge is None:
        with WarmJudge() as own_judge:
            return falsify(
                entrant,
                problem,
                plan,
                tier=tier,
                out=out,
                judge=own_judge,
                watch=watch,
                finish=finish,
            )
    split = "" if isinstance(problem, Task) else plan.split
    with Drives(
        entrant, problem, split, whole, about, tier, out, judge, watch, plan.physics
    ) as drives:
        envelopes = [
            Search(drives, number, space, steps, plan.seed + place, share).run()
            for place, (number, share) in enumerate(numbers)
        ]
        searched = drives.count
        curves = _curves(drives, points, plan)
        own = drives, searched, envelopes, curves
        found = _record(entrant, problem, plan, space, *own)
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
            write_atomic(out / RECORD_FILE, found.model_dump_json(indent=2) + "\n")
        if finish is not None:
            finish(found)
    return found


def space_on(problem: Task | TaskSet, plan: SearchPlan) -> dict[str, float]:
    """The parts that are searched on a problem, with their sizes.

    Raises:
        TaskError: A part does not exist there, a size is not valid, or none is left.
    """
    if isinstance(problem, Task):
        ranges, poses = problem.setting.has_dropouts, True
    else:
        seen = problem.file.observed
        ranges, poses = "ranges" in seen, "pose" in seen
    own = isinstance(problem, Task)
    space = space_of(plan.space, ranges=ranges, own_world=own)
    blind = [name for name in space if name.startswith("pose_") and not poses]
    if blind and plan.space is not None:
        raise TaskError(f"{blind[0]}: no pose is observed on {problem.name}")
    return {name: size for name, size in space.items() if name not in blind}


def _numbers(problem: Task | TaskSet, plan: SearchPlan) -> list[tuple[int, int]]:
    """Worlds, or the seed of a task, and the episodes of each."""
    if isinstance(problem, Task):
        return [(plan.seed, plan.episodes)]
    numbers = plan.chosen or tuple(range(plan.worlds))
    least = max(*numbers, plan.curves - 1)
    problem.check_count(plan.split, 1 + least, "worlds")
    share = plan.episodes // len(numbers)
    if share < LEAST:
        raise TaskError(
            f"{plan.episodes} episodes are too few for {len(numbers)} worlds: expected "
            f"at least {LEAST} for each"
        )
    return [(number, share) for number in numbers]


def steps_on(problem: Task | TaskSet, space: Mapping[str, float]) -> dict[str, float]:
    """Parts with multiples of a value alone: whole steps, and whole pixels of a map."""
    found = {n: 1.0 for n in space if DEVIATIONS[n].unit == "steps"}
    if isinstance(problem, Task) and problem.setting.units.place == "px":
        pixel = 1.0 / problem.nominal.body_radius
        found |= {name: pixel for name in space if name.startswith("obstacles")}
    return found


def _points(
    space: Mapping[str, float], steps: Mapping[str, float]
) -> list[tuple[str, float]]:
    """Values of single parts at which success is counted.

    Those of the start are left out: jittered starts have places of their own.
    """
    found = []
    for name, size in space.items():
        if name in START:
            continue
        signs = (-1, 1) if DEVIATIONS[name].signed else (1,)
        step, times = steps.get(name, 0.0), range(1, round(MOST) + 1)
        values = sorted(
            {0.0, *(near(s * n * size, step) for s in signs for n in times)}
        )
        limit = limit_of(name, size)
        found += [(name, value) for value in values if abs(value) <= limit + 1e-9]
    return found


def _curves(
    drives: Drives, points: list[tuple[str, float]], plan: SearchPlan
) -> list[Point]:
    """How often the policy succeeds at each of these points."""
    found = []
    seeds = range(plan.seed + 1, plan.seed + 1 + plan.curves)
    numbers = seeds if isinstance(drives.problem, Task) else range(plan.curves)
    for name, value in points:
        deviation = Deviation.of({name: value})
        if not drives.is_possible(deviation):
            continue
        cases = [Case(number=number, deviation=deviation) for number in numbers]
        rows = [row for row in drives.drive(cases, JITTER) if row is not None]
        successes = sum(row.success for row in rows)
        found.append(
            Point(part=name, value=value, count=len(rows), successes=successes)
        )
    return found


def _record(
    entrant: Searched,
    problem: Task | TaskSet,
    plan: SearchPlan,
    space: dict[str, float],
    drives: Drives,
    searched: int,
    envelopes: list[Envelope],
    curves: list[Point],
) -> Falsification:
    if isinstance(problem, Task):
        units, nominal = problem.setting.shown, problem.nominal
        radius, dt = nominal.body_radius, nominal.dt
        dynamics = problem.dynamics()
        sha256 = problem.sha256()
    else:
        units = printed_units(problem.file)
        task = problem.task(plan.split, 0)
        radius, dt = task.body_radius, task.dt
        dynamics, sha256 = problem.dynamics, problem.sha256
    return Falsification(
        name=problem.name,
        sha256=sha256,
        dynamics=dynamics,
        policy=entrant.name,
        policy_sha256=entrant.sha256,
        split=None if isinstance(problem, Task) else plan.split,
        unit=units.place,
        frame=frame_of(units),
        radius=radius,
        dt=dt,
        space=space,
        seed=plan.seed,
        physics=plan.physics,
        budget=plan.episodes,
        episodes=searched,
        sandbox=drives.used,
        envelopes=tuple(envelopes),
        curves=tuple(curves),
        versions=dict(versions()),
    )
