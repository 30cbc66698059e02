"""Drives entrants of every kind on the same worlds of task sets."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from tdac_agent.bench.compared import Driven, Episodes, figures_of, overall_of, pairs_of
from tdac_agent.bench.entrants import (
    Member,
    Named,
    Worlds,
    drive,
    knows,
    member_of,
    named,
)
from tdac_agent.bench.figures import draw_figures
from tdac_agent.bench.page import MOST_WORLDS, Replay, write_page
from tdac_agent.bench.record import Bench, BenchFile, BenchRow, BenchSet
from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.errors import ControllerFileError, RunError
from tdac_agent.evaluation.kept_sets import ROWS_FILE, TRAJECTORIES, kept_report
from tdac_agent.evaluation.salt import SEALED, drawn_salt
from tdac_agent.evaluation.set_report import SetReport
from tdac_agent.evaluation.set_verify import MOST_EPISODES
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.locks import LOCK_FILE, hold
from tdac_agent.tasks.provenance import sha256_of, versions
from tdac_agent.verification.judge.set_job import WorldEpisode
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_envs.core.arguments import one_of, whole_number
from tdac_envs.core.errors import TaskError
from tdac_envs.core.intake import RECORD_BYTES, read_file
from tdac_envs.ladder.source import read_salt
from tdac_envs.ladder.task_sets import AnyTask, TaskSet, load_set

WORLDS = 100
RESULTS, WORLD_TABLE, TIMING = "bench.json", "worlds.csv", "timing.csv"
SALT = "salt.hex"
ENTRANTS = "entrants.json"
"""Record of what drives on hidden worlds, written before their salt is drawn."""
DRIVEN = "driven"
"""Folder with what each file did on each set; of hidden worlds, it is in `sealed`."""
SPLITS = "dev", "test", "hidden"
Watch = Callable[[str, str, int, int], None]


@dataclass(frozen=True, slots=True)
class _Part:
    """An entrant on a set.

    Attributes:
        tasks: The set.
        entrant: The entrant.
        members: Its files; empty if it cannot drive.
        problem: Why it cannot.
    """

    tasks: TaskSet
    entrant: Named
    members: tuple[Member, ...] = ()
    problem: str | None = None


@dataclass(frozen=True, slots=True)
class _Arena:
    """What all parts share; see `bench`."""

    split: str
    count: int
    salt_file: Path | None
    tier: str
    out: Path
    judge: WarmJudge
    watch: Watch | None
    driven: dict[str, list[Driven]] = field(default_factory=dict)
    rows: list[dict[str, Any]] = field(default_factory=list)
    timing: list[dict[str, Any]] = field(default_factory=list)
    replays: dict[str, list[Replay]] = field(default_factory=dict)

    @property
    def salt_sha256(self) -> str | None:
        """Hash of the salt of hidden worlds."""
        return None if self.salt_file is None else sha256_of(read_salt(self.salt_file))


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

    Raises:
        TaskError: An argument is not valid.
        ControllerFileError: A file is missing.
        RunError: `out` cannot be used, or has another bench.
        Fault: The sandbox is broken.
    """
    one_of("split", split, SPLITS)
    whole_number("worlds", worlds, 1, MOST_EPISODES)
    if salt_file is not None and split != "hidden":
        raise TaskError("a salt file needs the split hidden")
    wanted, tasks = named(entrants), [load_set(name) for name in sets]
    _check_sets(tasks, split, worlds)
    parts = [_part(each, own) for own in tasks for each in wanted]
    with contextlib.ExitStack() as stack:
        _take(out, stack)
        drawn = split == "hidden" and salt_file is None
        if drawn:
            _record(out, parts, worlds)
            salt_file = drawn_salt(out / SEALED, reuse=True)
        if split == "hidden":
            (out / SEALED).mkdir(0o700, exist_ok=True)
        warm = judge or stack.enter_context(WarmJudge())
        arena = _Arena(split, worlds, salt_file, tier, out, warm, watch)
        rows = [_row(arena, part) for part in parts]
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
        tasks_of = {own.name: _first_tasks(arena, own) for own in tasks}
        write_page(found, arena.replays, tasks_of, figures, out)
        write_atomic(out / RESULTS, found.model_dump_json(indent=2) + "\n")
    return found


def publish(out: Path, rows: Sequence[dict[str, Any]], salt_file: Path | None) -> None:
    """Writes a row for each episode, and the salt of worlds that were hidden."""
    write_atomic(out / WORLD_TABLE, pd.DataFrame(rows).to_csv(index=False))
    if salt_file is not None:
        write_atomic(out / SALT, f"{salt_file.read_bytes().hex()}\n")


def _part(entrant: Named, tasks: TaskSet) -> _Part:
    try:
        members = tuple(member_of(word, tasks) for word in entrant.words)
    except (TaskError, ControllerFileError) as error:
        return _Part(tasks, entrant, problem=str(error))
    return _Part(tasks, entrant, members)


def _record(out: Path, parts: Sequence[_Part], worlds: int) -> None:
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


def _take(out: Path, stack: contextlib.ExitStack) -> None:
    """Takes a folder for a bench.

    Raises:
        RunError: It cannot be used.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        held = stack.enter_context(hold(out / LOCK_FILE))
    except OSError as error:
        raise RunError(f"cannot write to {out}: {error.strerror}") from error
    if not held:
        raise RunError(f"another bench writes to {out}; wait until it ends")


def _set_of(arena: _Arena, tasks: TaskSet) -> BenchSet:
    return BenchSet(
        name=tasks.name,
        sha256=tasks.sha256,
        split=arena.split,
        worlds=arena.count,
        salt_sha256=arena.salt_sha256,
    )


def _row(arena: _Arena, part: _Part) -> BenchRow:
    """Drives an entrant on a set, unless it has been driven already."""
    members, tasks = part.members, part.tasks
    row = BenchRow(set=tasks.name, entrant=part.entrant.name, problem=part.problem)
    if not members:
        return row
    steps = [member.steps for member in members]
    about: dict[str, Any] = {
        "kind": members[0].kind,
        "knows": knows(members[0], tasks),
        "tuned": members[0].tuned,
        "steps": None if None in steps else sum(filter(None, steps)),
        "files": tuple(BenchFile(sha256=each.sha256) for each in members),
    }
    try:
        reports = [_report(arena, part, member) for member in members]
    except ControllerFileError as error:
        return row.model_copy(update={**about, "problem": str(error)})
    if refused := next((report for report, _ in reports if report.refused), None):
        return row.model_copy(update={**about, "problem": "; ".join(refused.told)})
    episodes = [episodes for _, episodes in reports]
    found = Driven.of(part.entrant.name, episodes)
    arena.driven.setdefault(tasks.name, []).append(found)
    arena.rows.extend(world_rows(tasks.name, part.entrant.name, episodes))
    arena.replays.setdefault(tasks.name, []).extend(_replays(arena, part, episodes))
    arena.timing.append(_timing(tasks.name, part.entrant.name, episodes))
    about["files"] = tuple(
        BenchFile(
            sha256=member.sha256, hidden=report.hidden.count if report.hidden else None
        )
        for member, (report, _) in zip(members, reports, strict=True)
    )
    clocks = [report.clock_dependent for report, _ in reports]
    about["clock_dependent"] = next(filter(None, clocks), None)
    return row.model_copy(update={**about, **figures_of(found, episodes)})


def folder_of(place: Path, name: str, sha256: str) -> Path:
    """Folder of what a file did on a set."""
    return place / name / sha256[:16]


def _report(
    arena: _Arena, part: _Part, member: Member
) -> tuple[SetReport, tuple[WorldEpisode, ...]]:
    """The report of a file, and its episodes."""
    tasks, split, count = part.tasks, arena.split, arena.count
    place = SEALED if split == "hidden" else DRIVEN
    folder = folder_of(arena.out / place, tasks.name, member.sha256)
    report = kept_report(
        folder, member.sha256, tasks.sha256, split, count, arena.salt_sha256
    )
    if report is None:

        def watch(episodes: int, successes: int) -> None:
            if arena.watch is not None:
                arena.watch(tasks.name, part.entrant.name, episodes, successes)

        watch(0, 0)
        folder.mkdir(parents=True, exist_ok=True)
        worlds = Worlds(tasks, split, count, arena.salt_file, arena.tier)
        report = drive(member, worlds, folder, arena.judge, watch)
    if report.episodes or report.refused:
        return report, report.episodes
    return report, sealed_episodes(folder, member.sha256)


def sealed_episodes(folder: Path, sha256: str) -> tuple[WorldEpisode, ...]:
    """The episodes of a file on hidden worlds.

    Args:
        folder: Folder of the file.
        sha256: Hash of the file.

    Raises:
        RunError: They are not there, since the worlds were driven elsewhere.
    """
    path = folder / SEALED / ROWS_FILE
    try:
        lines = read_file(path, RECORD_BYTES).splitlines()
    except OSError:
        raise RunError(
            f"{path} is missing: the file {sha256[:8]} was driven on these hidden "
            "worlds before; use the folder of that bench, or another salt"
        ) from None
    return tuple(map(WorldEpisode.model_validate_json, lines))


def _first_tasks(arena: _Arena, tasks: TaskSet) -> dict[int, AnyTask]:
    """The tasks of the worlds whose episodes are shown."""
    if not arena.replays.get(tasks.name):
        return {}
    count = min(arena.count, MOST_WORLDS)
    return {index: tasks.task(arena.split, index) for index in range(count)}


def _replays(arena: _Arena, part: _Part, episodes: Episodes) -> Iterator[Replay]:
    """The first episodes of an entrant's first file, if they may be shown."""
    if arena.split == "hidden":
        return
    folder = folder_of(arena.out / DRIVEN, part.tasks.name, part.members[0].sha256)
    for episode in episodes[0][:MOST_WORLDS]:
        path = folder / TRAJECTORIES / f"{episode.index}.npz"
        if path.is_file():
            trajectory = Trajectory.load(path)
            name, outcome = part.entrant.name, episode.outcome
            yield Replay(name, episode.index, outcome, trajectory)


def _timing(name: str, entrant: str, episodes: Episodes) -> dict[str, Any]:
    """The row of `timing.csv`, which differs from one machine to another."""
    steps = sum(each.steps for part in episodes for each in part)
    seconds = sum(each.cpu_seconds for part in episodes for each in part)
    return {
        "set": name,
        "entrant": entrant,
        "steps": steps,
        "cpu_seconds": round(seconds, 3),
        "ms_per_step": round(1e3 * seconds / max(steps, 1), 3),
    }


def world_rows(name: str, entrant: str, episodes: Episodes) -> list[dict[str, Any]]:
    """The rows of `worlds.csv`."""
    return [
        {
            "set": name,
            "entrant": entrant,
            "file": number,
            "success": episode.success,
            **episode.model_dump(exclude={"text", "cpu_seconds"}),
        }
        for number, own in enumerate(episodes)
        for episode in own
    ]
