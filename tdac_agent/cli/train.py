"""`tdac train`: shows live progress, a line per evaluation, and the best policy."""

from __future__ import annotations

import itertools
import json
import math
import shlex
import sys
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from tdac_agent.cli.console import Console
from tdac_agent.cli.evaluate import wrapper_names
from tdac_agent.cli.flags import flag
from tdac_agent.cli.set_flags import check_set
from tdac_agent.episodes.sb3_file import POLICY
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.training.curve import Point
from tdac_agent.training.plan import (
    EVALUATIONS,
    TrainingPlan,
    make_plan,
    read_plan,
)
from tdac_agent.training.set_plan import SELECTED, TRAINED, make_set_plan, set_of
from tdac_agent.training.train import check_extra, train
from tdac_envs.core.errors import TaskError

NOISES = tuple(field.name for field in fields(Disturbance))
LEARNT_AT = 0.95
"""Success rate from which a policy counts as having learnt its tasks."""


def run(
    given: dict[str, Any],
    steps: int | None,
    out: Path | None,
    resume: Path | None,
    trust: bool,
    as_json: bool,
) -> int:
    """Trains a policy and prints the results; returns 1 if it did not learn, else 0.

    Args:
        given: Values of the given flags by name, except the following.
        steps: Training steps of all robots together; None for the default.
        out: Training folder; the next free one by default.
        resume: Folder of a training to continue.
        trust: Whether to load its checkpoint even if it is from elsewhere.
        as_json: Whether to print JSON.
    """
    check_extra()
    console = Console(stderr=as_json)
    with console.status("preparing the tasks …"):
        plan, folder = _plan_and_folder(given, steps, out, resume)
    console.print(_heading(plan, folder), soft_wrap=True, highlight=False)
    columns = (
        TextColumn("{task.completed:,.0f} steps"),
        BarColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[best]}"),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        watch = _Watch(bar, console, plan)
        try:
            points = train(plan, folder, watch, trust=trust)
        except KeyboardInterrupt:
            command = shlex.join(["tdac", "train", "--resume", str(folder)])
            console.print(escape(f"to continue: {command}"), soft_wrap=True)
            raise
    best = max(points, key=lambda point: point.worth)
    if as_json:
        found = {"folder": str(folder), "best": _json(best)}
        sys.stdout.write(json.dumps(found, indent=2) + "\n")
    else:
        _show(plan, folder, best, points[-1], console)
    return 0 if best.success_rate >= _learnt_at(plan) else 1


def _learnt_at(plan: TrainingPlan) -> float:
    """Success rate from which the policy has learnt: on a set, the set's bar."""
    return LEARNT_AT if plan.set is None else set_of(plan).file.bar


class _Watch:
    """Shows training steps in a progress bar and evaluations as lines."""

    def __init__(self, bar: Progress, console: Console, plan: TrainingPlan) -> None:
        self._bar, self._console = bar, console
        self._row = bar.add_task("", total=plan.steps, rate="", best="")
        self._first: int | None = None

    def __call__(self, steps: int, point: Point | None, best: Point | None) -> None:
        self._first = steps if self._first is None else self._first
        elapsed = self._bar.tasks[self._row].elapsed
        rate = (steps - self._first) / elapsed if elapsed else 0.0
        shown = "" if best is None else f"best {best.success_rate:.0%}"
        self._bar.update(
            self._row, completed=steps, rate=f"{rate:,.0f} steps/s", best=shown
        )
        if point is not None:
            self._console.print(_line(point, point is best), highlight=False)


def _plan_and_folder(
    given: dict[str, Any], steps: int | None, out: Path | None, resume: Path | None
) -> tuple[TrainingPlan, Path]:
    """The training plan and the training folder.

    Raises:
        TaskError: Flags contradict each other, or a value is out of range.
    """
    if resume is not None:
        refused = [flag(name) for name in given] + ["--out"] * (out is not None)
        if refused:
            names = ", ".join(refused)
            raise TaskError(
                f"--resume continues a training as it was begun: leave out {names}"
            )
        plan = read_plan(resume)
        if steps is not None:
            interval = max(steps // EVALUATIONS, 1)
            update = {"steps": steps, "evaluate_every": interval}
            plan = plan.model_copy(update=update)
        return plan, resume
    only_tasks = {
        flag(name): given.get(name) for name in ("task", "variation", *NOISES)
    }
    check_set(given.get("set"), {}, only_tasks)
    wanted = {name: v for name, v in given.items() if name not in NOISES}
    if "wrapper" in wanted:
        wanted["wrappers"] = tuple(wrapper_names(wanted.pop("wrapper")))
    if "set" in wanted:
        plan = make_set_plan(wanted.pop("set"), steps=steps, **wanted)
        return plan, out or _next_folder(plan)
    tasks = tuple(wanted.pop("task", ("maze",)))
    noise: dict[str, Any] = dict.fromkeys(NOISES, 0)
    noise |= {name: given[name] for name in NOISES if name in given}
    plan = make_plan(tasks, steps=steps, disturbance=Disturbance(**noise), **wanted)
    return plan, out or _next_folder(plan)


def _next_folder(plan: TrainingPlan) -> Path:
    first = plan.tasks[0] if plan.set is None else plan.set
    name = f"{plan.algo}-{Path(first).stem}"
    folders = (Path("runs") / f"{name}-{number}" for number in itertools.count(1))
    return next(folder for folder in folders if not folder.exists())


def _heading(plan: TrainingPlan, folder: Path) -> str:
    wrappers = ", ".join(plan.wrappers) or "none"
    return (
        f"[bold]{plan.algo.upper()}[/] on [bold]{escape(plan.worlds)}[/]: "
        f"{plan.steps:,} steps of {plan.n_envs} robots, {_starts(plan)}, seed "
        f"{plan.seed}; observation wrappers: {wrappers}; {escape(str(folder))}"
    )


def _starts(plan: TrainingPlan) -> str:
    if plan.set is not None:
        return f"worlds of {TRAINED} ({plan.episodes} of {SELECTED} in evaluations)"
    trained = plan.env_kwargs.get("variation", plan.variation)
    if trained == plan.variation:
        return f"{trained} starts"
    return f"{trained} starts ({plan.variation} in evaluations)"


def _line(point: Point, best: bool) -> str:
    return (
        f"{point.steps:>10,} steps {point.seconds:>5.0f} s  "
        f"reached {point.success_rate:>4.0%}  hit {point.collision_rate:>4.0%}  "
        f"return {point.mean_return:>6.2f}" + ("  [green]best[/]" if best else "")
    )


def _show(
    plan: TrainingPlan, folder: Path, best: Point, last: Point, console: Console
) -> None:
    learnt = best.success_rate >= _learnt_at(plan)
    mark = "[green]✔[/]" if learnt else "[red]✘ not learnt:[/]"
    file = folder / POLICY
    console.print(
        f"{mark} {best.success_rate:.0%} of {plan.episodes} evaluation episodes "
        f"reached the goal, {best.collision_rate:.0%} hit something, after "
        f"{best.steps:,} of {last.steps:,} steps and {best.seconds:.0f} of "
        f"{last.seconds:.0f} s",
        highlight=False,
        soft_wrap=True,
    )
    if last.steps != best.steps:
        console.print(
            f"at the end: {last.success_rate:.0%} reached the goal, "
            f"{last.collision_rate:.0%} hit something; the best policy is kept",
            highlight=False,
            soft_wrap=True,
        )
    words = ["evaluate", str(file), "follow-guidance", "reference"]
    words += [word for name in plan.tasks for word in ("--task", name)]
    if plan.set is not None:
        words = ["bench", str(file), "builtin", "--set", plan.set]
    line = escape(f"to compare: {shlex.join(['tdac', *words])}")
    console.print(line, soft_wrap=True, highlight=False)


def _json(point: Point) -> dict[str, float | None]:
    return {k: None if math.isnan(v) else v for k, v in asdict(point).items()}
