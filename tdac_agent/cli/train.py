"""`tdac train`: shows live progress, a line per evaluation, and the best policy."""

from __future__ import annotations

import itertools
import math
import shlex
import statistics
from dataclasses import asdict, fields, replace
from pathlib import Path

from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from tdac_agent.cli.console import Console, print_json
from tdac_agent.cli.evaluate import wrapper_names
from tdac_agent.cli.sentences import print_plain
from tdac_agent.cli.task_choice import check_scope, kind_of_file
from tdac_agent.cli.task_flags import TaskFlags
from tdac_agent.cli.train_flags import TrainOptions
from tdac_agent.episodes.sb3_file import POLICY
from tdac_agent.option_fields import flag_name, typed_fields
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.training.curve import Point
from tdac_agent.training.first_weights import begun_from
from tdac_agent.training.plan import (
    EVALUATIONS,
    TrainingPlan,
    make_plan,
    read_plan,
)
from tdac_agent.training.seeds import seed_folder, train_seeds
from tdac_agent.training.set_plan import SELECTED, TRAINED, make_set_plan, set_of
from tdac_agent.training.train import check_extra, train
from tdac_envs.core.errors import TaskError

NOISES = tuple(field.name for field in fields(Disturbance))
WITH_RESUME = ("resume", "steps", "trust", "as_json")
PLANNED = ("algo", "steps", "seed", "n_envs", "episodes", "config", "variation")
"""Flags that are arguments of the plan."""
LEARNT_AT = 0.95
"""Success rate from which a policy counts as having learnt its tasks."""


def run(options: TrainOptions) -> int:
    """Trains a policy and prints the results; returns 1 if it did not learn, else 0."""
    check_extra()
    console = Console(stderr=options.as_json)
    with console.status("preparing the tasks …"):
        plan, folder = _plan_and_folder(_with_named_files(options))
    if options.seeds is not None:
        return _run_seeds(options, plan, folder, console)
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
            points = train(plan, folder, watch, trust=options.trust)
        except KeyboardInterrupt:
            command = shlex.join(["tdac", "train", "--resume", str(folder)])
            print_plain(console, f"to continue: {command}")
            raise
    best = _best(points)
    if options.as_json:
        print_json({"folder": str(folder), "best": _json(best)})
    else:
        _show(plan, folder, best, points[-1], console)
    return 0 if best.success_rate >= _learnt_at(plan) else 1


def _run_seeds(
    options: TrainOptions, plan: TrainingPlan, folder: Path, console: Console
) -> int:
    """Trains with several seeds and prints the results; returns as `run` does."""
    first, count = plan.seed, options.seeds or 1
    seeds = range(first, first + count)
    console.print(
        f"{_heading(plan, folder)}; {count} seeds", soft_wrap=True, highlight=False
    )
    columns = (
        TextColumn("{task.completed:,.0f} steps"),
        BarColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        row = bar.add_task("", total=plan.steps * count)
        done = dict.fromkeys(seeds, 0)

        def watch(seed: int, steps: int, point: Point | None) -> None:
            done[seed] = steps
            bar.update(row, completed=sum(done.values()))
            if point is not None:
                bar.console.print(f"seed {seed} {_line(point, False)}", highlight=False)

        try:
            curves = train_seeds(plan, seeds, folder, watch, trust=options.trust)
        except KeyboardInterrupt:
            print_plain(console, f"to continue: the same command, with --out {folder}")
            raise
    best = {seed: _best(points) for seed, points in curves.items()}
    if options.as_json:
        print_json(
            {"folder": str(folder), "best": {s: _json(p) for s, p in best.items()}}
        )
    else:
        _show_seeds(plan, folder, best, curves, console)
    learnt = _learnt_at(plan)
    return 0 if all(point.success_rate >= learnt for point in best.values()) else 1


def _best(points: list[Point]) -> Point:
    return max(points, key=lambda point: point.worth)


def _show_seeds(
    plan: TrainingPlan,
    folder: Path,
    best: dict[int, Point],
    curves: dict[int, list[Point]],
    console: Console,
) -> None:
    rates = [point.success_rate for point in best.values()]
    last = [points[-1].success_rate for points in curves.values()]
    console.print(
        f"reached the goal in {plan.episodes} evaluation episodes: "
        f"{statistics.mean(rates):.0%} on average over the seeds "
        f"({min(rates):.0%} to {max(rates):.0%}); "
        f"{statistics.mean(last):.0%} at the end",
        highlight=False,
        soft_wrap=True,
    )
    for seed, point in best.items():
        file = seed_folder(folder, seed) / POLICY
        print_plain(
            console,
            f"  seed {seed}: {point.success_rate:>4.0%} after {point.steps:,} steps, "
            f"{point.seconds:.0f} s; {curves[seed][-1].success_rate:>4.0%} at the end "
            f"({file})",
        )
    if plan.set is not None:
        files = [str(seed_folder(folder, seed)) for seed in best]
        words = ["tdac", "bench", *files, "builtin", "--set", plan.set]
        print_plain(console, f"to compare: {shlex.join(words)}")


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


def _with_named_files(options: TrainOptions) -> TrainOptions:
    """The options, with files that have no flag as those of their flags.

    Raises:
        TaskError: A file is no task and no task set, or there is more than one set.
    """
    for file in options.files:
        kind = kind_of_file(file)
        if kind == "task":
            options = replace(options, tasks=(*options.tasks, file))
        elif kind == "set_name" and options.set_name is None:
            options = replace(options, set_name=file)
        else:
            raise TaskError(f"{file!r}: expected task.yaml files, or one set.yaml")
    return replace(options, files=())


def _plan_and_folder(options: TrainOptions) -> tuple[TrainingPlan, Path]:
    """The training plan and the training folder.

    Raises:
        TaskError: Flags contradict each other, or a value is out of range.
    """
    if options.resume is not None:
        refused = [
            flag_name(f) for f in typed_fields(options) if f.name not in WITH_RESUME
        ]
        if refused:
            names = ", ".join(refused)
            raise TaskError(
                f"--resume continues a training as it was begun: leave out {names}"
            )
        plan = read_plan(options.resume)
        if options.steps is not None:
            interval = max(options.steps // EVALUATIONS, 1)
            update = {"steps": options.steps, "evaluate_every": interval}
            plan = plan.model_copy(update=update)
        return plan, options.resume
    typed = {f.name: getattr(options, f.name) for f in typed_fields(options)}
    wanted = {name: typed[name] for name in PLANNED if name in typed}
    if options.wrappers is not None:
        wanted["wrappers"] = tuple(wrapper_names(options.wrappers))
    if options.uses != "rays":
        if options.wrappers is not None:
            raise TaskError("--uses chooses the wrappers: leave out --wrapper")
        wanted["uses"] = options.uses
    if options.set_name is not None:
        check_scope(True, TaskFlags(), options)
        plan = make_set_plan(options.set_name, **wanted)
    else:
        check_scope(False, TaskFlags(), options)
        noise = Disturbance(**{name: getattr(options, name) for name in NOISES})
        plan = make_plan(options.tasks or ("maze",), disturbance=noise, **wanted)
    if options.from_policy is not None:
        plan = begun_from(plan, options.from_policy)
    return plan, options.out or _next_folder(plan)


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
    print_plain(console, f"to compare: {shlex.join(['tdac', *words])}")


def _json(point: Point) -> dict[str, float | None]:
    return {k: None if math.isnan(v) else v for k, v in asdict(point).items()}
