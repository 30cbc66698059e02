"""Evaluates policies of any kind on the same tasks and seeds."""

from __future__ import annotations

import contextlib
import itertools
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_agent.errors import Fault
from tdac_agent.evaluation.entrants import Entrant, entrants_of, write_builtin
from tdac_agent.evaluation.evaluation_report import (
    EvaluatedPolicy,
    EvaluatedTask,
    Evaluation,
    Result,
    Timing,
    comparisons_of,
    row_of,
    timing_of,
)
from tdac_agent.evaluation.finished import (
    EPISODE_TABLE,
    RESULTS,
    TIMING,
    finished_evaluation,
)
from tdac_agent.evaluation.overlay import Overlay, draw_overlay
from tdac_agent.evaluation.unfinished import folder_of, open_store
from tdac_agent.runs.ownership import load_task
from tdac_agent.sandbox import Limits
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.provenance import versions
from tdac_agent.tasks.task import Task, display_name, lay_out
from tdac_agent.verification.diagnosis.measures import Measured
from tdac_agent.verification.judge.kept_episodes import KeptEpisode, kept_episodes
from tdac_agent.verification.judge.seeded import SeededJob
from tdac_agent.verification.judge.sequential import MOST_EPISODES
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.seeded_run import run_seeds
from tdac_envs.core.arguments import one_of, whole_number
from tdac_envs.core.errors import TaskError
from tdac_envs.drive.task import VARIATIONS

EPISODES = 100
NO_DISTURBANCE = Disturbance(0.0, 0.0, 0.0, 0)
NOT_VERIFIED = "tdac synth verified no candidate; this is its last one"
Watch = Callable[[str, str, int, int], None]


def evaluate(
    policies: Sequence[str | Path],
    tasks: Sequence[Task | str | Path] = ("maze",),
    episodes: int = EPISODES,
    *,
    seed: int = 0,
    variation: str = "jitter",
    wrappers: Sequence[str] | None = None,
    tier: str = "auto",
    limits: Limits | None = None,
    out: Path | None = None,
    judge: WarmJudge | None = None,
    watch: Watch | None = None,
) -> Evaluation:
    """Runs policies on the same episodes, and compares them.

    Each episode has a seed that is drawn from `seed`, and from which the environment
    draws start and noise. Controllers run in the sandbox, in a fresh process for each
    episode. Only the weights are read from saved networks.

    Args:
        policies: Any mix of controller files, run folders, `.zip` files saved by
            stable-baselines3, and the names `reference`, `builtin`, `random`,
            `go-to-goal` and `follow-guidance`.
        tasks: Tasks, or names and paths for `load_task`.
        episodes: Number of episodes of each policy on each task.
        seed: Seed from which the seeds of the episodes are drawn.
        variation: Variation of the starts: `nominal`, `jitter`, `mixed`, or `random`,
            which also varies the goals.
        wrappers: Wrappers of saved policies that do not record their own.
        tier: Sandbox tier; `auto` for the best one on this machine.
        limits: Limits of a controller's process in each episode.
        out: Folder for `evaluation.json`, `episodes.csv`, `timing.csv`, and a picture
            of each task; by default nothing is written. Until then it keeps each
            finished episode: after an interruption, the same call continues. If it
            has this evaluation already, that one is returned and nothing is driven.
        judge: A warm judge; None starts one for this call.
        watch: Called repeatedly with task, policy, episodes and successes so far.

    Returns:
        The evaluation. Any error of a policy counts as a failed episode.

    Raises:
        TaskError: A task or a number is invalid, or a run folder is for another
            environment than a task, or for a task set.
        ControllerFileError: A policy's file cannot be read, or is no policy.
        RunError: Another evaluation is in `out`, or writes to it.
        Fault: The sandbox is broken.
    """
    whole_number("episodes", episodes, 1, MOST_EPISODES)
    whole_number("seed", seed, 0)
    one_of("variation", variation, VARIATIONS)
    entrants = entrants_of(policies, wrappers)
    for entrant in entrants:
        if entrant.set_file is not None:
            raise TaskError(
                f"{entrant.name} was written for a task set, not for tasks: evaluate "
                f"it with --set {entrant.set_file}"
            )
        if entrant.saved is not None and entrant.saved.set is not None:
            own = entrant.saved.set
            raise TaskError(
                f"{entrant.name} was trained on the task set {own!r}, not on tasks: "
                "evaluate it with --set"
            )
    loaded = load_tasks(tasks)
    for entrant, task in itertools.product(entrants, loaded):
        if entrant.env not in (None, task.spec.env):
            raise TaskError(
                f"{entrant.name} was written for {entrant.env}; the task "
                f"{task.name!r} is of {task.spec.env}"
            )
    about: dict[str, Any] = {
        "variation": variation,
        "seed": seed,
        "episodes": episodes,
        "tasks": tuple(map(_about_task, loaded)),
        "policies": tuple(map(_about_policy, entrants)),
        "versions": versions(),
    }
    if out is not None and (done := finished_evaluation(out, about)) is not None:
        return done
    seeds = episode_seeds(seed, episodes)
    results: list[Result] = []
    timings: list[Timing] = []
    written = RESULTS, EPISODE_TABLE, TIMING, "*.png"
    with contextlib.ExitStack() as stack:
        store = stack.enter_context(open_store(out, *written))
        warm = judge or stack.enter_context(WarmJudge())
        for task in loaded:
            folder = Path(
                stack.enter_context(
                    tempfile.TemporaryDirectory(prefix="tdac-evaluate-")
                )
            )
            job = SeededJob(
                task=lay_out(task, folder / "work"),
                policy=entrants[0].policy,
                disturbance=NO_DISTURBANCE,
                variation=variation,
                seeds=seeds,
                test=None,
                keep=store,
                tier=tier,
                limits=limits or Limits(),
                out=folder / "results",
            )
            overlays = []
            for number, entrant in enumerate(entrants):
                at = job.model_copy(update={"out": folder / f"results-{number}"})
                result, calls, kept = _compete(entrant, task, at, warm, watch)
                results.append(result)
                timings.append(timing_of(task.name, entrant.name, calls))
                overlays.append(Overlay.of(result, kept))
            if out is not None:
                draw_overlay(task, overlays, out / f"{task.name}.png")
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


def episode_seeds(seed: int, episodes: int) -> tuple[int, ...]:
    """Seeds of the episodes, drawn from the seed of an evaluation."""
    return tuple(np.random.SeedSequence(seed).generate_state(episodes).tolist())


def write_evaluation(found: Evaluation, out: Path) -> None:
    """Writes the results to a folder; wall times go to a separate file."""
    write_atomic(out / RESULTS, found.model_dump_json(indent=2) + "\n")
    write_atomic(out / EPISODE_TABLE, found.to_frame().to_csv(index=False))
    write_atomic(out / TIMING, found.timing_frame().to_csv(index=False))


def load_tasks(tasks: Sequence[Task | str | Path]) -> list[Task]:
    """Loads the tasks that are given by name or path.

    Raises:
        TaskError: No task is given, one cannot be used, or two have the same name,
            which results and pictures are named after.
    """
    loaded = [task if isinstance(task, Task) else load_task(task) for task in tasks]
    if not loaded:
        raise TaskError("expected at least one task")
    names = [task.name for task in loaded]
    for name in names:
        if names.count(name) > 1:
            raise TaskError(f"two tasks are called {name!r}: evaluate them one by one")
    return loaded


def _compete(
    entrant: Entrant, task: Task, job: SeededJob, judge: WarmJudge, watch: Watch | None
) -> tuple[Result, NDArray[np.float32], list[KeptEpisode]]:
    """Runs a policy on a task; returns the result, call times in s, and episodes.

    Episodes that `job.keep` has already are not driven again.
    """
    policy, sha256, note = entrant.policy, entrant.sha256, None
    if entrant.is_builtin:
        if watch is not None:
            watch(task.name, entrant.name, 0, 0)
        source, verified = write_builtin(task, job.tier)
        file = job.out.with_suffix(".py")
        file.write_bytes(source)
        policy, sha256 = replace(policy, file=file), sha256_of(source)
        note = None if verified else NOT_VERIFIED

    request = job.model_copy(update={"policy": policy})
    assert job.keep is not None
    keep = folder_of(job.keep, task, request, sha256)
    before = kept_episodes(keep, job.seeds)
    reached = sum(each.figures.success for each in before.values())

    def progress(count: int, successes: int) -> None:
        if watch is not None:
            watch(task.name, entrant.name, len(before) + count, reached + successes)

    progress(0, 0)
    missing = tuple(seed for seed in job.seeds if seed not in before)
    if missing:
        late = sum(each.late for each in before.values())
        rest = {"keep": keep, "seeds": missing, "late": late}
        request = request.model_copy(update=rest)
        run_seeds(request, task.nominal, Measured, judge, progress)
    kept = {**before, **kept_episodes(keep, missing)}
    if lost := [seed for seed in job.seeds if seed not in kept]:
        raise Fault(f"the judge did not keep the episodes of {len(lost)} seeds")
    episodes = [kept[seed] for seed in job.seeds]
    tiers = [each.tier for each in episodes if each.tier]
    result = Result(
        task=task.name,
        policy=entrant.name,
        knows=policy.knows,
        episodes=tuple(each.figures for each in episodes),
        sandbox=tiers[-1] if tiers else job.tier,
        controller_sha256=sha256,
        note=note,
    )
    calls = np.concatenate([each.calls for each in episodes])
    return result, calls, episodes


def _about_task(task: Task) -> EvaluatedTask:
    return EvaluatedTask(
        name=task.name,
        called=display_name(task),
        task_sha256=task.sha256(),
        map_sha256=task.setting.world_sha256(),
        unit=task.setting.units.place,
        body_radius=task.nominal.body_radius,
    )


def _about_policy(entrant: Entrant) -> EvaluatedPolicy:
    policy = entrant.policy
    return EvaluatedPolicy(
        name=entrant.name,
        kind=policy.kind,
        knows=policy.knows,
        wrappers=policy.wrappers,
        sha256=entrant.sha256,
    )
