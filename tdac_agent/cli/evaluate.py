"""`tdac evaluate`: compares policies of any kind on the same tasks and seeds."""

from __future__ import annotations

import sys
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from rich.markup import escape

from tdac_agent.cli.console import Console
from tdac_agent.cli.evaluate_view import show_evaluation
from tdac_agent.cli.flags import TaskFlags, check_tier
from tdac_agent.cli.policy_bar import policy_bar
from tdac_agent.cli.sentences import print_sentences
from tdac_agent.errors import ControllerFileError, Fault
from tdac_agent.evaluation.evaluate import evaluate, load_problems
from tdac_agent.evaluation.policies import entrants_of
from tdac_agent.storage.files import write_atomic
from tdac_agent.tasks.task import Task
from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.store import count_unfinished
from tdac_envs.core.errors import TaskError

if TYPE_CHECKING:
    import pandas as pd

NO_WRAPPERS = "none"


def run(
    policies: list[str],
    tasks: list[str],
    flags: TaskFlags,
    episodes: int,
    seed: int,
    variation: Literal["nominal", "jitter", "mixed", "random"],
    wrappers: list[str] | None,
    csv: Path | None,
    out: Path | None,
    tier: str,
    as_json: bool,
) -> int:
    """Evaluates the policies and prints the results; returns the exit code."""
    check_tier(tier)
    names = None if wrappers is None else wrapper_names(wrappers)
    entrants_of(policies, names)  # fails early on a wrong name
    check_outputs(csv, out)
    console = Console(stderr=as_json)
    bar = policy_bar(console)
    row = bar.add_task("", total=episodes, successes=0, doing="preparing")

    is_driven = False

    def watch(task: str, policy: str, count: int, successes: int) -> None:
        nonlocal is_driven
        is_driven = True
        doing = escape(f"{task}: {policy}")
        bar.update(row, completed=count, successes=successes, doing=doing, refresh=True)

    with ChildPool() as child_pool, _keeping(console, out):
        loaded = load_problems(_tasks(tasks, flags))
        with WarmJudge(child_pool) as judge, bar:
            found = evaluate(
                policies,
                loaded,
                episodes,
                seed=seed,
                variation=variation,
                wrappers=names,
                tier=tier,
                out=out,
                judge=judge,
                watch=watch,
            )
    if csv is not None:
        write_csv(found.to_frame(), csv)
    if as_json:
        sys.stdout.write(found.model_dump_json(indent=2) + "\n")
    else:
        units = {
            task.name: task.setting.shown for task in loaded if isinstance(task, Task)
        }
        show_evaluation(found, console, units)
        if out is not None and not is_driven:
            done = f"{out} already has this evaluation; nothing was driven"
            print_sentences(console, done)
        elif out is not None:
            pictures = ", ".join(f"{task.name}.png" for task in found.tasks)
            files = f"evaluation.json, episodes.csv, timing.csv, {pictures}"
            console.print(escape(f"wrote {files} to {out}"), soft_wrap=True)
    if found.all_crashed:
        console.print("[red]every policy crashed in every episode[/]")
        return 1
    return 0


def _tasks(names: list[str], flags: TaskFlags) -> list[Task]:
    """The tasks that `--task` names, then that of `--map` or `--world`, if any.

    Raises:
        TaskError: Flags contradict each other, or a task cannot be used.
    """
    shown = TaskFlags(frame=flags.frame)
    if flags.map_image or flags.world:
        named = [replace(shown, task=name) for name in names]
        return [each.load() for each in (*named, flags)]
    others = replace(flags, frame=None).words()
    if others:
        raise TaskError(f"{others[0]} needs --map or --world")
    return [replace(shown, task=name).load() for name in names or ["maze"]]


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


def wrapper_names(words: list[str]) -> list[str]:
    """The names of the wrappers; `none` alone stands for an empty list.

    Raises:
        TaskError: `none` is combined with other names.
    """
    if words == [NO_WRAPPERS]:
        return []
    if NO_WRAPPERS in words:
        raise TaskError("--wrapper none cannot be combined with another --wrapper")
    return words


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
