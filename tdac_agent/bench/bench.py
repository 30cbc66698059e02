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
    Part,
    Watch,
    first_tasks,
    part_of,
    row_of,
)
from tdac_agent.bench.compared import overall_of, pairs_of
from tdac_agent.bench.entrants import named
from tdac_agent.bench.figures import draw_figures
from tdac_agent.bench.jobs import Drive, Reached, drive_all, drives_of
from tdac_agent.bench.page import PAGE, write_page
from tdac_agent.bench.record import Bench, BenchSet
from tdac_agent.errors import RunError
from tdac_agent.evaluation.salt import SEALED, drawn_salt
from tdac_agent.evaluation.set_verify import MOST_EPISODES
from tdac_agent.executors.executor import Executor
from tdac_agent.storage.csv_file import TABLE_BYTES, read_rows
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.locks import own_folder
from tdac_agent.tasks.provenance import versions
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_envs.core.arguments import one_of, whole_number
from tdac_envs.core.errors import TaskError
from tdac_envs.core.intake import RECORD_BYTES, read_file
from tdac_envs.ladder.source import read_salt
from tdac_envs.ladder.task_sets import TaskSet, load_set

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
    sets: Sequence[str | Path],
    split: str = "test",
    worlds: int = WORLDS,
    *,
    out: Path,
    salt_file: Path | None = None,
    tier: str = "auto",
    judge: WarmJudge | None = None,
    watch: Watch | None = None,
    executor: Executor[Reached, Drive] | None = None,
    workers: int = 1,
) -> Bench:
    """Drives entrants on the first worlds of a split of each set.

    An entrant that cannot drive on a set is a row with the reason. After an
    interruption, the same call goes on.

    Args:
        entrants: Words as for `entrants.named`.
        sets: Names of task sets, or paths of set files.
        split: `dev`, `test` or `hidden`.
        worlds: Number of worlds of each set.
        out: Folder for `bench.json`, `timing.csv`, `worlds.csv`, figures and
            `driven/`. Of hidden worlds, single episodes are in `sealed/`, which only
            this user can read.
        salt_file: File with the salt of hidden worlds, which stay sealed. By default a
            salt is drawn when all entrants are on record, and revealed at the end.
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
    wanted, tasks = named(entrants), [load_set(name) for name in sets]
    _check_sets(tasks, split, worlds)
    parts = [part_of(each, own) for own in tasks for each in wanted]
    with contextlib.ExitStack() as stack:
        stack.enter_context(own_folder(out, *WRITTEN, who="bench"))
        drawn = split == "hidden" and salt_file is None
        if drawn:
            _record(out, parts, worlds)
            salt_file = drawn_salt(out / SEALED, reuse=True)
        if split == "hidden":
            (out / SEALED).mkdir(0o700, exist_ok=True)
        warm = judge or stack.enter_context(WarmJudge())
        arena = Arena(split, worlds, salt_file, tier, out, warm, watch)
        if executor is not None:
            given = [name for name in sets for _ in wanted]
            drives = drives_of(arena, list(zip(given, parts, strict=True)))
            drive_all(arena, drives, executor, workers)
        rows = [row_of(arena, part) for part in parts]
        found = Bench(
            versions=dict(versions()),
            sets=tuple(_set_of(arena, each) for each in tasks),
            entrants=tuple(each.name for each in wanted),
            rows=tuple(rows),
            overall=overall_of(arena.driven) if len(tasks) > 1 else (),
            pairs=pairs_of(arena.driven),
        )
        public = split != "hidden" or drawn
        if public:
            publish(out, arena.rows, salt_file)
        write_atomic(out / TIMING, pd.DataFrame(arena.timing).to_csv(index=False))
        table = pd.DataFrame(arena.rows) if public else None
        figures = draw_figures(found, table, out)
        tasks_of = {own.name: first_tasks(arena, own) for own in tasks}
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


def _record(out: Path, parts: Sequence[Part], worlds: int) -> None:
    """Writes down what will drive, before a salt is drawn for it.

    Raises:
        RunError: A salt has been drawn for something else.
    """
    entries = [
        {
            "set": part.tasks.name,
            "set_sha256": part.tasks.sha256,
            "worlds": worlds,
            "entrant": part.entrant.name,
            "files": [member.sha256 for member in part.members],
        }
        for part in parts
    ]
    text = json.dumps(entries, indent=2) + "\n"
    path = out / ENTRANTS
    if path.is_file() and read_file(path, RECORD_BYTES) != text.encode():
        raise RunError(
            f"{out} has a salt that was drawn for other entrants, sets or worlds: give "
            "another --out"
        )
    write_atomic(path, text)


def _check_sets(tasks: Sequence[TaskSet], split: str, worlds: int) -> None:
    names = [each.name for each in tasks]
    for name in names:
        if names.count(name) > 1:
            raise TaskError(f"the task set {name!r} is given twice")
    if not tasks:
        raise TaskError("expected at least one task set")
    for each in tasks:
        each.check_count(split, worlds, "worlds")
        each.runs(split, worlds)


def _set_of(arena: Arena, tasks: TaskSet) -> BenchSet:
    return BenchSet(
        name=tasks.name,
        sha256=tasks.sha256,
        split=arena.split,
        worlds=arena.count,
        salt_sha256=arena.salt_sha256,
    )
