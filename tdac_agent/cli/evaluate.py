"""`tdac evaluate`: compares policies of any kind on the same episodes."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeGuard

from tdac_agent.cli.console import Console, print_json
from tdac_agent.cli.driving_bar import DrivingBar
from tdac_agent.cli.evaluate_flags import EvaluateOptions
from tdac_agent.cli.evaluate_view import show_evaluation
from tdac_agent.cli.sentences import print_plain, print_sentences
from tdac_agent.cli.task_choice import (
    check_scope,
    check_tier,
    chosen_task,
    kind_of_file,
    with_named_file,
)
from tdac_agent.cli.task_flags import TaskFlags
from tdac_agent.errors import ControllerFileError, Fault
from tdac_agent.evaluation.evaluate import (
    EPISODES,
    POLICIES,
    Problem,
    evaluate,
    load_problems,
)
from tdac_agent.evaluation.evaluation_report import Evaluation
from tdac_agent.evaluation.policies import entrants_of
from tdac_agent.option_fields import flag_name, typed_fields
from tdac_agent.storage.files import write_atomic
from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.store import count_unfinished
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.task_sets import TaskSet, load_set

if TYPE_CHECKING:
    import pandas as pd

NO_WRAPPERS = "none"


def run(flags: TaskFlags, options: EvaluateOptions) -> int:
    """Evaluates the policies and prints the results; returns the exit code."""
    check_tier(options.tier)
    options, flags = _with_named_files(options, flags)
    check_scope(flags.set_name is not None, flags, options)
    wrappers = None if options.wrappers is None else wrapper_names(options.wrappers)
    if flags.set_name is None:
        entrants_of(options.policies, wrappers)  # fails early on a wrong name
    check_outputs(options.csv, options.out)
    console = Console(stderr=options.as_json)
    with ChildPool() as child_pool, _keeping(console, options.out):
        problems = load_problems(_problems(options.tasks, flags))
        count = _count(problems, options)
        bar = DrivingBar(console, count)
        with WarmJudge(child_pool) as judge, bar:
            results = evaluate(
                options.policies,
                problems,
                count,
                seed=options.seed,
                variation=options.variation,
                split=options.split,
                physics=options.physics,
                wrappers=wrappers,
                tier=options.tier,
                out=options.out,
                judge=judge,
                watch=lambda task, name, n, won: bar.show(n, won, f"{task}: {name}"),
            )
    if options.csv is not None:
        write_csv(results.to_frame(), options.csv)
    if options.as_json:
        print_json(results)
    else:
        show_evaluation(results, console, problems)
    if options.out is not None and not options.as_json:
        _print_written(results, options.out, bar, console)
    if results.all_crashed:
        console.print("[red]every policy crashed in every episode[/]")
        return 1
    return 0


def _count(problems: Sequence[Problem], options: EvaluateOptions) -> int:
    """Episodes per policy and problem; at most as many as a set has worlds."""
    worlds = [each.count(options.split) for each in problems if _is_set(each)]
    return options.episodes or min([EPISODES, *filter(None, worlds)])


def _is_set(problem: Problem) -> TypeGuard[TaskSet]:
    return isinstance(problem, TaskSet)


def _print_written(
    results: Evaluation, out: Path, bar: DrivingBar, console: Console
) -> None:
    if not bar.counts[0]:
        done = f"{out} already has this evaluation; nothing was driven"
        print_sentences(console, done)
        return
    pictures = [f"{task.name}.png" for task in results.tasks if task.split is None]
    names = ["evaluation.json", "episodes.csv", "timing.csv", *pictures]
    print_plain(console, f"wrote {', '.join(names)}, {POLICIES}/ to {out}")


def _with_named_files(
    options: EvaluateOptions, flags: TaskFlags
) -> tuple[EvaluateOptions, TaskFlags]:
    """The options, with tasks and sets among the policies as those of their flags."""
    policies, tasks = [], [*options.tasks]
    for name in options.policies:
        kind = None if Path(name).is_dir() else kind_of_file(name)
        if kind is None:
            policies.append(name)
        elif kind == "task":
            tasks.append(name)
        else:
            flags = with_named_file(replace(flags, file=name))
    if not policies:
        raise TaskError("no policy: give files, run folders, or names such as builtin")
    return replace(options, policies=tuple(policies), tasks=tuple(tasks)), flags


def _problems(names: Sequence[str], flags: TaskFlags) -> list[Problem]:
    """The set, or the tasks that `--task` names and that of `--map` or `--world`.

    Raises:
        TaskError: Flags contradict each other, or a task cannot be used.
    """
    if flags.set_name is not None:
        return [load_set(flags.set_name)]
    shown = TaskFlags(frame=flags.frame, metres=flags.metres)
    if flags.map_image or flags.world:
        named = [replace(shown, task=name) for name in names]
        return [chosen_task(each) for each in (*named, flags)]
    changes = typed_fields(flags.changes)
    if changes and len(names) > 1:
        raise TaskError(f"{flag_name(changes[0])} changes one task: give one --task")
    return [chosen_task(replace(flags, task=name)) for name in names or ["maze"]]


@contextmanager
def _keeping(console: Console, out: Path | None) -> Generator[None]:
    """Reports the finished episodes that an interrupted evaluation left or leaves."""
    if out is not None and (before := count_unfinished(out)):
        left = f"{before} finished episodes of an interrupted evaluation"
        print_sentences(console, f"{out} has {left}; none of them is driven again")
    try:
        yield
    except (KeyboardInterrupt, Fault, OSError):
        if out is not None and (now := count_unfinished(out)):
            kept = f"{now} finished episodes are kept in {out}"
            print_sentences(console, f"{kept}; the same command continues from there")
        raise


def wrapper_names(words: Sequence[str]) -> list[str]:
    """The names of the wrappers; `none` alone stands for an empty list.

    Raises:
        TaskError: `none` is combined with other names.
    """
    if list(words) == [NO_WRAPPERS]:
        return []
    if NO_WRAPPERS in words:
        raise TaskError("--wrapper none cannot be combined with another --wrapper")
    return list(words)


def check_outputs(csv: Path | None, out: Path | None) -> None:
    """Checks before the work begins that the outputs can be written.

    Raises:
        ControllerFileError: One of them cannot be written.
    """
    if csv is not None and not csv.absolute().parent.is_dir():
        raise ControllerFileError(f"cannot write {csv}: no such folder")
    if csv is not None and csv.is_dir():
        raise ControllerFileError(f"cannot write {csv}: it is a folder")
    if out is not None:
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            reason = error.strerror
            raise ControllerFileError(f"cannot write to {out}: {reason}") from error


def write_csv(rows: pd.DataFrame, csv: Path) -> None:
    """Writes a row for each episode.

    Raises:
        ControllerFileError: The file cannot be written.
    """
    try:
        write_atomic(csv, rows.to_csv(index=False))
    except OSError as error:
        raise ControllerFileError(f"cannot write {csv}: {error.strerror}") from error
