"""Evaluates policies of any kind in the same episodes of tasks or task sets."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tdac_agent.episodes.trajectory import Trajectory, load_calls
from tdac_agent.errors import RunError
from tdac_agent.evaluation.evaluation_report import (
    EvaluatedPolicy,
    EvaluatedProblem,
    Evaluation,
    Result,
    Timing,
    comparisons_of,
    row_of,
    timing_of,
)
from tdac_agent.evaluation.overlay import Overlay, draw_overlay
from tdac_agent.evaluation.policies import (
    Entrant,
    entrants_of,
    fitted,
    knowledge,
    prepared,
)
from tdac_agent.problems.episodes import check_physics, episodes_of
from tdac_agent.problems.part import Part, identity_of
from tdac_agent.runs.ownership import load_task
from tdac_agent.sandbox import Limits
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.locks import own_folder
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.provenance import versions
from tdac_agent.tasks.task import Task, display_name
from tdac_agent.verification.drive_episodes import Request, drive
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.judge.sequential import MOST_EPISODES
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.store import TRAJECTORIES, kept_report
from tdac_agent.verification.verify_episodes import part_of_set
from tdac_envs.core.arguments import one_of, whole_number
from tdac_envs.core.errors import TaskError
from tdac_envs.core.intake import one_line, parse_json, read_file
from tdac_envs.drive.task import VARIATIONS
from tdac_envs.ladder.task_sets import TaskSet
from tdac_envs.physics.moved import EXACT

EPISODES = 100
RESULTS, EPISODE_TABLE, TIMING = "evaluation.json", "episodes.csv", "timing.csv"
POLICIES = "policies"
"""Folder with the episodes of each policy on each problem."""
NO_DISTURBANCE = Disturbance(0.0, 0.0, 0.0, 0)
NOT_PASSED = "no candidate of tdac synth passed; this is its last one"
MOST_LATE = 3
"""Time-outs of a policy on a task after which the rest is skipped."""
_MOST = 512 << 20
Problem = Task | TaskSet
Watch = Callable[[str, str, int, int], None]


def evaluate(
    policies: Sequence[str | Path],
    tasks: Sequence[Problem | str | Path] = ("maze",),
    episodes: int = EPISODES,
    *,
    seed: int = 0,
    variation: str = "jitter",
    split: str = "test",
    physics: str = EXACT,
    wrappers: Sequence[str] | None = None,
    tier: str = "auto",
    limits: Limits | None = None,
    out: Path | None = None,
    judge: WarmJudge | None = None,
    watch: Watch | None = None,
) -> Evaluation:
    """Drives policies in the same episodes, and compares them.

    On a task, each episode has a seed that is drawn from `seed`, and from which the
    environment draws start and noise; on a task set, it is a world, from world 0 on.
    Controllers run in the sandbox, in a fresh process for each episode. Only the
    weights are read from saved networks.

    Args:
        policies: Any mix of controller files, run folders, `.zip` files saved by
            stable-baselines3, and the names `reference`, `builtin`, `random`,
            `go-to-goal` and `follow-guidance`.
        tasks: Tasks, names and paths for `load_task`, and task sets.
        episodes: Number of episodes of each policy on each of them.
        seed: Seed from which the seeds of the episodes are drawn.
        variation: Variation of a task's starts: `nominal`, `jitter`, `mixed`, or
            `random`, which also varies the goals.
        split: Split of a set: `dev` or `test`.
        physics: What moves the robot: `exact`, or `mujoco`.
        wrappers: Wrappers of saved policies that do not record their own.
        tier: Sandbox tier; `auto` for the best one on this machine.
        limits: Limits of a controller's process in each episode.
        out: Folder for `evaluation.json`, `episodes.csv`, `timing.csv`, a picture of
            each task, and in `policies/` what each policy did; by default nothing is
            kept. After an interruption, the same call goes on. If it has this
            evaluation already, that one is returned and nothing is driven.
        judge: A warm judge; None starts one for this call.
        watch: Called repeatedly with task, policy, episodes and successes so far.

    Returns:
        The evaluation. Any error of a policy counts as a failed episode.

    Raises:
        TaskError: An argument is not valid, or a policy does not drive on a task.
        ControllerFileError: A policy's file cannot be read, is no policy, or was
            trained elsewhere.
        RunError: Another evaluation is in `out`, or writes to it.
        Fault: The sandbox is broken.
    """
    whole_number("episodes", episodes, 1, MOST_EPISODES)
    whole_number("seed", seed, 0)
    one_of("variation", variation, VARIATIONS)
    entrants, problems = entrants_of(policies, wrappers), load_problems(tasks)
    on_sets = [isinstance(each, TaskSet) for each in problems]
    for each in problems:
        _refuse_hidden(each, split)
    parts = [
        replace(
            part_of(each, episodes, seed=seed, variation=variation, split=split),
            physics=physics,
        )
        for each in problems
    ]
    for each in problems:
        check_physics(each, physics)
    own = [[fitted(each, problem) for each in entrants] for problem in problems]
    about: dict[str, Any] = {
        "variation": None if all(on_sets) else variation,
        "seed": None if all(on_sets) else seed,
        "episodes": episodes,
        "physics": physics,
        "tasks": tuple(map(_about_problem, problems, parts)),
        "policies": tuple(map(_about_policy, entrants)),
        "versions": versions(),
    }
    with contextlib.ExitStack() as stack:
        if out is None:
            folder = tempfile.TemporaryDirectory(prefix="tdac-evaluate-")
            place = Path(stack.enter_context(folder))
        else:
            written = RESULTS, EPISODE_TABLE, TIMING, POLICIES, "*.png"
            stack.enter_context(own_folder(out, *written, who="evaluation"))
            place = out
            if (done := _finished(out, about, parts)) is not None:
                return done
        warm = judge or stack.enter_context(WarmJudge())
        terms = _Terms(place, tier, limits, warm, watch)
        results, timings = list[Result](), list[Timing]()
        for problem, part, fitting in zip(problems, parts, own, strict=True):
            driven = [_compete(each, problem, part, terms) for each in fitting]
            results += [result for result, _ in driven]
            timings += [_timing(*each) for each in driven]
            if out is not None and isinstance(problem, Task):
                overlays = [_overlay(*each) for each in driven]
                draw_overlay(problem, overlays, out / f"{problem.name}.png")
        found = Evaluation(
            **about,
            rows=tuple(map(row_of, results)),
            comparisons=comparisons_of(results),
            results=tuple(results),
            timings=tuple(timings),
        )
        if out is not None:
            write_evaluation(found, out)
    return found


def write_evaluation(found: Evaluation, out: Path) -> None:
    """Writes the results to a folder; wall times go to a separate file."""
    write_atomic(out / EPISODE_TABLE, found.to_frame().to_csv(index=False))
    write_atomic(out / TIMING, found.timing_frame().to_csv(index=False))
    write_atomic(out / RESULTS, found.model_dump_json(indent=2) + "\n")


def load_problems(tasks: Sequence[Problem | str | Path]) -> list[Problem]:
    """Loads the tasks that are given by name or path.

    Raises:
        TaskError: None is given, one cannot be used, or two have the same name, which
            results and pictures are named after.
    """
    loaded = [
        each if isinstance(each, Task | TaskSet) else load_task(each) for each in tasks
    ]
    if not loaded:
        raise TaskError("expected at least one task")
    names = [task.name for task in loaded]
    for name in names:
        if names.count(name) > 1:
            raise TaskError(f"two tasks are called {name!r}: evaluate them one by one")
    return loaded


def episode_seeds(seed: int, episodes: int) -> tuple[int, ...]:
    """Seeds of the episodes, drawn from the seed of an evaluation."""
    return tuple(np.random.SeedSequence(seed).generate_state(episodes).tolist())


def part_of(
    problem: Problem,
    episodes: int,
    *,
    seed: int = 0,
    variation: str = "jitter",
    split: str = "test",
    salt_file: Path | None = None,
) -> Part:
    """The episodes of an evaluation on a problem; see `evaluate`.

    Raises:
        TaskError: The set has no such worlds, or they are hidden without a salt.
    """
    if isinstance(problem, Task):
        seeds = episode_seeds(seed, episodes)
        return Part(seeds, disturbance=NO_DISTURBANCE, variation=variation)
    return part_of_set(problem, split, episodes, salt_file=salt_file)[0]


def _refuse_hidden(problem: Problem, split: str) -> None:
    if isinstance(problem, TaskSet) and split == "hidden":
        raise TaskError(
            "hidden worlds are evaluated one controller at a time, and counted: tdac "
            f"verify FILE --set {problem.name} --split hidden --salt-file FILE"
        )


@dataclass(frozen=True, slots=True)
class _Terms:
    """What all policies of an evaluation share.

    Attributes:
        place: Folder of the results.
        tier: Sandbox tier.
        limits: Limits of a controller's process.
        judge: A warm judge.
        watch: Called with task, policy, episodes and successes so far.
    """

    place: Path
    tier: str
    limits: Limits | None
    judge: WarmJudge
    watch: Watch | None


Driven = tuple[Result, Path]
"""What a policy did, and the folder of its trajectories."""


def _compete(entrant: Entrant, problem: Problem, part: Part, terms: _Terms) -> Driven:
    """Drives a policy on a problem, unless it is on record already."""

    def watch(count: int, successes: int) -> None:
        if terms.watch is not None:
            terms.watch(problem.name, entrant.name, count, successes)

    watch(0, 0)
    folder = terms.place / POLICIES / problem.name
    folder.mkdir(parents=True, exist_ok=True)
    entrant, passed = prepared(entrant, problem, terms.tier)
    note = None if passed else NOT_PASSED
    request = Request(
        entrant.policy,
        entrant.sha256,
        episodes_of(problem),
        part,
        source=entrant.source,
        weights=entrant.weights,
        patience=MOST_LATE if isinstance(problem, Task) else None,
        tier=terms.tier,
        limits=terms.limits,
        trajectories=True,
    )
    own = folder / _folder_name(entrant.name, entrant.sha256)
    report = _kept(own, request.sha256, _about_problem(problem, part), part)
    if report is None:
        report = drive(request, own, terms.judge, watch)
    knows = knowledge(entrant.policy, problem)
    return Result(problem.name, entrant.name, knows, report, note), own / TRAJECTORIES


def _folder_name(name: str, sha256: str | None) -> str:
    return f"{Path(name).stem}-{(sha256 or 'ours')[:8]}"


def _kept(
    folder: Path, sha256: str, about: EvaluatedProblem, part: Part
) -> EpisodeReport | None:
    same = about.model_dump(include={"name", "sha256", "dynamics"})
    wanted: dict[str, Any] = {"controller_sha256": sha256, **same}
    wanted |= {"split": part.split} if part.split else {"variation": part.variation}
    wanted |= {"physics": part.physics}
    return kept_report(folder, wanted, part.numbers)


def _timing(result: Result, trajectories: Path) -> Timing:
    files = [trajectories / f"{each.number}.npz" for each in result.episodes]
    calls = [load_calls(file) for file in files if file.is_file()]
    every = np.concatenate(calls) if calls else np.zeros(0, np.float32)
    return timing_of(result.task, result.policy, every)


def _overlay(result: Result, trajectories: Path) -> Overlay:
    files = [trajectories / f"{each.number}.npz" for each in result.episodes]
    return Overlay.of(result, [Trajectory.load(file) for file in files])


def _about_problem(problem: Problem, part: Part) -> EvaluatedProblem:
    if isinstance(problem, TaskSet):
        return EvaluatedProblem(
            name=problem.name,
            **identity_of(episodes_of(problem)),
            split=part.split,
            unit=problem.file.unit,
        )
    return EvaluatedProblem(
        name=problem.name,
        called=display_name(problem),
        **identity_of(episodes_of(problem)),
        map_sha256=problem.setting.world_sha256(),
        unit=problem.setting.units.place,
    )


def _about_policy(entrant: Entrant) -> EvaluatedPolicy:
    policy = entrant.policy
    return EvaluatedPolicy(
        name=entrant.name,
        kind=policy.kind,
        wrappers=policy.wrappers,
        sha256=entrant.sha256 or None,
    )


def _finished(
    out: Path, about: dict[str, Any], parts: Sequence[Part]
) -> Evaluation | None:
    """The evaluation in a folder, if it is complete and the wanted one.

    Raises:
        RunError: The folder has another evaluation, or one that cannot be read.
    """
    if not (out / RESULTS).is_file():
        return None
    pictures = [f"{each.name}.png" for each in about["tasks"] if each.split is None]
    written = (EPISODE_TABLE, TIMING, *pictures)
    try:
        found = Evaluation.model_validate(parse_json(read_file(out / RESULTS, _MOST)))
    except (OSError, ValueError, TypeError) as error:
        raise RunError(
            f"{out / RESULTS} cannot be read ({one_line(error)[:120]}); give another "
            "folder with --out"
        ) from error
    if other := ", ".join(_differences(found, about)):
        raise RunError(
            f"{out} already has an evaluation, of {_summary(found)}; it differs in "
            f"{other}: give another folder with --out"
        )
    if not all((out / name).is_file() for name in written):
        return None
    about_of = {task.name: task for task in found.tasks}
    part_of = {task.name: part for task, part in zip(found.tasks, parts, strict=True)}
    driven: list[Driven] = []
    for row in found.rows:
        name = _folder_name(row.policy, row.controller_sha256)
        folder, sha256 = out / POLICIES / row.task / name, row.controller_sha256 or ""
        report = _kept(folder, sha256, about_of[row.task], part_of[row.task])
        if report is None:
            return None
        result = Result(row.task, row.policy, row.knows, report, row.note)
        driven.append((result, folder / TRAJECTORIES))
    results = tuple(result for result, _ in driven)
    timings = tuple(_timing(*each) for each in driven)
    return found.model_copy(update={"results": results, "timings": timings})


def _differences(found: Evaluation, wanted: dict[str, Any]) -> Iterator[str]:
    """What differs from the wanted evaluation, in words."""
    own = {
        "policies": "files",
        "tasks": "settings",
    }
    for name, settings in own.items():
        before = getattr(found, name)
        if [each.name for each in before] != [each.name for each in wanted[name]]:
            yield name
        elif before != wanted[name]:
            yield f"the {settings} of the {name}"
    for name in ("episodes", "variation", "seed"):
        if getattr(found, name) != wanted[name]:
            yield f"--{name}"
    if found.versions != wanted["versions"]:
        yield "package versions"


def _summary(found: Evaluation) -> str:
    policies, tasks = (
        ", ".join(each.name for each in entries)
        for entries in (found.policies, found.tasks)
    )
    count = found.episodes
    facts = [f"{count} episode{'s' if count > 1 else ''} each"]
    if found.seed is not None:
        facts += [str(found.variation), f"seed {found.seed}"]
    return f"{policies} on {tasks} ({', '.join(facts)})"
