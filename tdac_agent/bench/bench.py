"""Drives entrants of every kind on the same worlds of task sets."""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from tdac_agent.bench.arena import (
    DRIVEN,
    Arena,
    Entry,
    Problem,
    Watch,
    entry_of,
    first_tasks,
    row_of,
    runs_of,
)
from tdac_agent.bench.compared import overall_of, pairs_of
from tdac_agent.bench.entrants import named
from tdac_agent.bench.figures import draw_figures
from tdac_agent.bench.jobs import Drive, Reached, drive_all, drives_of
from tdac_agent.bench.page import PAGE, write_page
from tdac_agent.bench.record import Bench, BenchSet
from tdac_agent.errors import RunError
from tdac_agent.executors.executor import Executor
from tdac_agent.problems.episodes import check_physics, episodes_of
from tdac_agent.problems.part import identity_of
from tdac_agent.runs.ownership import load_task
from tdac_agent.storage.csv_file import TABLE_BYTES, read_rows
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.locks import own_folder
from tdac_agent.tasks.provenance import versions
from tdac_agent.verification.judge.sequential import MOST_EPISODES
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.salt import SEALED, drawn_salt
from tdac_envs.core.arguments import one_of, whole_number
from tdac_envs.core.errors import TaskError
from tdac_envs.core.intake import RECORD_BYTES, read_file
from tdac_envs.core.salt import read_salt
from tdac_envs.ladder.task_sets import TaskSet, load_set
from tdac_envs.physics.moved import EXACT

WORLDS = 100
RESULTS, WORLD_TABLE, TIMING = "bench.json", "worlds.csv", "timing.csv"
SALT = "salt.hex"
ENTRANTS = "entrants.json"
WRITTEN = (
    *(RESULTS, WORLD_TABLE, TIMING, SALT, ENTRANTS, PAGE, "*.svg"),
    *(SEALED, DRIVEN),
)
"""Record of what drives on hidden worlds, written before their salt is drawn."""
SPLITS = "dev", "test", "hidden"


def bench(
    entrants: Sequence[str],
    sets: Sequence[str | Path] = (),
    split: str = "test",
    worlds: int = WORLDS,
    *,
    out: Path,
    tasks: Sequence[str | Path] = (),
    salt_file: Path | None = None,
    physics: str = EXACT,
    tier: str = "auto",
    judge: WarmJudge | None = None,
    watch: Watch | None = None,
    executor: Executor[Reached, Drive] | None = None,
    workers: int = 1,
) -> Bench:
    """Drives entrants on the first worlds of a split of each set, and on tasks.

    An entrant that cannot drive on a set is a row with the reason. After an
    interruption, the same call goes on.

    Args:
        entrants: Words as for `entrants.named`.
        sets: Names of task sets, or paths of set files.
        split: `dev`, `test` or `hidden`.
        worlds: Number of worlds of each set, and of episodes of each task, which have
            jittered starts.
        tasks: Names or paths of tasks.
        out: Folder for `bench.json`, `timing.csv`, `worlds.csv`, figures and
            `driven/`. Of hidden worlds, single episodes are in `sealed/`, which only
            this user can read.
        salt_file: File with the salt of hidden worlds, which stay sealed. By default a
            salt is drawn when all entrants are on record, and revealed at the end.
        physics: What moves the robots: `exact`, or `mujoco`.
        tier: Sandbox tier.
        judge: A warm judge; None starts one for this call.
        watch: Called repeatedly with set, entrant, episodes and successes so far.
        executor: Distributes the files, each on each set, over `workers` processes. By
            default they drive one after another, each on all cores.
        workers: Number of processes of the executor.

    Raises:
        TaskError: An argument is not valid.
        ControllerFileError: A file is missing.
        RunError: `out` cannot be used, or has another bench.
        Fault: The sandbox is broken.
    """
    one_of("split", split, SPLITS)
    whole_number("worlds", worlds, 1, MOST_EPISODES)
    whole_number("workers", workers, 1)
    if salt_file is not None and split != "hidden":
        raise TaskError("a salt file needs the split hidden")
    if salt_file is not None:
        read_salt(salt_file)  # fails here, before there is a folder
    if tasks and split == "hidden":
        raise TaskError("tasks have no hidden worlds: leave them out")
    if physics != EXACT and split == "hidden":
        raise TaskError(
            f"hidden worlds are driven with the exact step alone: leave out physics "
            f"{physics!r}, or take the split test"
        )
    wanted, words = named(entrants), [*sets, *tasks]
    problems: list[Problem] = [*map(load_set, sets), *map(load_task, tasks)]
    _check_problems(problems, split, worlds)
    for each in problems:
        check_physics(each, physics)
    entries = [entry_of(each, own) for own in problems for each in wanted]
    with contextlib.ExitStack() as stack:
        stack.enter_context(own_folder(out, *WRITTEN, who="bench"))
        drawn = split == "hidden" and salt_file is None
        if drawn:
            _record(out, entries, worlds)
            salt_file = drawn_salt(out / SEALED, reuse=True)
        if split == "hidden":
            (out / SEALED).mkdir(0o700, exist_ok=True)
        warm = judge or stack.enter_context(WarmJudge())
        arena = Arena(split, worlds, salt_file, tier, out, warm, watch, physics)
        for own in problems:
            runs_of(own, arena)  # fails before anything is driven
        if executor is not None:
            given = [word for word in words for _ in wanted]
            drives = drives_of(arena, list(zip(given, entries, strict=True)))
            drive_all(arena, drives, executor, workers)
        rows = [row_of(arena, entry) for entry in entries]
        found = Bench(
            versions=dict(versions()),
            sets=tuple(_set_of(arena, each) for each in problems),
            entrants=tuple(each.name for each in wanted),
            rows=tuple(rows),
            overall=overall_of(arena.driven) if len(problems) > 1 else (),
            pairs=pairs_of(arena.driven),
        )
        public = split != "hidden" or drawn
        if public:
            publish(out, arena.rows, salt_file)
        write_atomic(out / TIMING, pd.DataFrame(arena.timing).to_csv(index=False))
        table = pd.DataFrame(arena.rows) if public else None
        figures = draw_figures(found, table, out)
        tasks_of = {own.name: first_tasks(arena, own) for own in problems}
        write_page(found, arena.replays, tasks_of, figures, out)
        write_atomic(out / RESULTS, found.model_dump_json(indent=2) + "\n")
    return found


def publish(out: Path, rows: Sequence[dict[str, Any]], salt_file: Path | None) -> None:
    """Writes a row for each episode, and the salt of worlds that were hidden."""
    write_atomic(out / WORLD_TABLE, pd.DataFrame(rows).to_csv(index=False))
    if salt_file is not None:
        write_atomic(out / SALT, f"{read_salt(salt_file).hex()}\n")


def read_worlds(file: Path) -> pd.DataFrame:
    """The table of `publish`.

    Raises:
        OSError: It cannot be read.
        ValueError: It is not such a table.
    """
    key = ["set", "entrant", "file", "index"]
    figures = ["success", "time_score"]
    read_rows(file, [*key, *figures], key)
    table = pd.read_csv(io.BytesIO(read_file(file, TABLE_BYTES)))
    if table[figures].astype(float).isna().any(axis=None):
        raise ValueError("a row without success or time_score")
    return table


def _record(out: Path, entries: Sequence[Entry], worlds: int) -> None:
    """Writes down what will drive, before a salt is drawn for it.

    Raises:
        RunError: A salt has been drawn for something else.
    """
    facts = [
        {
            "set": entry.problem.name,
            "set_sha256": episodes_of(entry.problem).sha256,
            "dynamics": episodes_of(entry.problem).dynamics,
            "worlds": worlds,
            "entrant": entry.entrant.name,
            "files": [member.sha256 for member in entry.members],
        }
        for entry in entries
    ]
    text = json.dumps(facts, indent=2) + "\n"
    path = out / ENTRANTS
    if path.is_file() and read_file(path, RECORD_BYTES) != text.encode():
        raise RunError(
            f"{out} has a salt that was drawn for other entrants, sets or worlds: give "
            "another --out"
        )
    write_atomic(path, text)


def _check_problems(problems: Sequence[Problem], split: str, worlds: int) -> None:
    names = [each.name for each in problems]
    for name in names:
        if names.count(name) > 1:
            raise TaskError(f"{name!r} is given twice")
    if not problems:
        raise TaskError("expected at least one task set or task")
    for each in problems:
        if isinstance(each, TaskSet):
            each.check_count(split, worlds, "worlds")


def _set_of(arena: Arena, problem: Problem) -> BenchSet:
    own, part = episodes_of(problem), arena.part(problem)
    return BenchSet(
        name=problem.name,
        **identity_of(own),
        split=part.split or part.variation,
        worlds=arena.count,
        salt_sha256=own.secret(part),
        physics=part.physics,
    )
