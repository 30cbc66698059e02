"""Drives the entrants of a bench, each on each task or task set."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from tdac_agent.bench.compared import Driven, Rows, figures_of
from tdac_agent.bench.entrants import Named, knows, member_of, request_of, steps_of
from tdac_agent.bench.page import MOST_WORLDS, Replay
from tdac_agent.bench.record import BenchFile, BenchRow
from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.errors import ControllerFileError, RunError
from tdac_agent.evaluation.evaluate import part_of
from tdac_agent.evaluation.policies import Entrant
from tdac_agent.problems.episodes import episodes_of
from tdac_agent.problems.part import Part, identity_of
from tdac_agent.tasks.task import Task
from tdac_agent.verification.drive_episodes import drive
from tdac_agent.verification.episode_report import EpisodeReport, named
from tdac_agent.verification.judge.episode_row import EpisodeRow
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.salt import SEALED
from tdac_agent.verification.store import (
    ROWS_FILE,
    TRAJECTORIES,
    is_marked,
    kept_report,
)
from tdac_envs.core.errors import TaskError
from tdac_envs.core.intake import RECORD_BYTES, read_file
from tdac_envs.ladder.task_sets import AnyTask, TaskSet
from tdac_envs.physics.moved import EXACT

DRIVEN = "driven"
"""Folder with what each file did on each set; of hidden worlds, it is in `sealed`."""
Problem = Task | TaskSet
Watch = Callable[[str, str, int, int], None]


@dataclass(frozen=True, slots=True)
class Entry:
    """An entrant on a task or a task set.

    Attributes:
        problem: The task or the task set.
        entrant: The entrant.
        members: Its files; empty if it cannot drive.
        reason: Why it cannot.
    """

    problem: Problem
    entrant: Named
    members: tuple[Entrant, ...] = ()
    reason: str | None = None


@dataclass(frozen=True, slots=True)
class Arena:
    """What all entrants share, and what they did.

    Attributes:
        split: Split of the worlds of sets.
        count: Number of episodes of each task or set.
        salt_file: File with the salt of hidden worlds.
        tier: Sandbox tier.
        out: Folder of the results.
        judge: A warm judge.
        watch: Called with set, entrant, episodes and successes so far.
        physics: What moves the robots.
        driven: Scores of each set, by its name.
        rows: Rows of `worlds.csv`.
        timing: Rows of `timing.csv`.
        replays: Episodes of each set to show.
    """

    split: str
    count: int
    salt_file: Path | None
    tier: str
    out: Path
    judge: WarmJudge
    watch: Watch | None
    physics: str = EXACT
    driven: dict[str, list[Driven]] = field(default_factory=dict)
    rows: list[dict[str, Any]] = field(default_factory=list)
    timing: list[dict[str, Any]] = field(default_factory=list)
    replays: dict[str, list[Replay]] = field(default_factory=dict)

    def part(self, problem: Problem) -> Part:
        """The episodes of a problem."""
        part = part_of(problem, self.count, split=self.split, salt_file=self.salt_file)
        return replace(part, physics=self.physics)

    def folder(self, problem: Problem, member: Entrant) -> Path:
        """Folder of what a file does on a problem."""
        place = SEALED if self.split == "hidden" else DRIVEN
        other = "" if self.physics == EXACT else f"-{self.physics}"
        return folder_of(self.out / place, problem.name + other, member.sha256)

    def kept(self, problem: Problem, member: Entrant) -> EpisodeReport | None:
        """The report of a file, if it has driven in all episodes of a problem."""
        own, part = episodes_of(problem), self.part(problem)
        wanted = {
            "controller_sha256": member.sha256,
            **identity_of(own),
            "split": part.split or None,
            "salt_sha256": own.secret(part),
            "physics": part.physics,
        }
        return kept_report(self.folder(problem, member), wanted, part.numbers)


class DrivenElsewhere(RunError):
    """The ledger has the result of a file, but its episodes are in another folder."""


def entry_of(entrant: Named, problem: Problem) -> Entry:
    """The files of an entrant for a problem, or why there are none."""
    try:
        members = tuple(member_of(word, problem) for word in entrant.words)
    except (TaskError, ControllerFileError) as error:
        return Entry(problem, entrant, reason=str(error))
    kinds = dict.fromkeys(m.saved.algo if m.saved else str(m.kind) for m in members)
    if len(kinds) > 1:
        reason = f"its files are not seeds of one training: {', '.join(kinds)}"
        return Entry(problem, entrant, reason=reason)
    if len({member.sha256 for member in members}) < len(members):
        return Entry(problem, entrant, reason="two of its files are the same")
    return Entry(problem, entrant, members)


def row_of(arena: Arena, entry: Entry) -> BenchRow:
    """Drives an entrant on a problem, unless it has been driven already."""
    members, problem, name = entry.members, entry.problem, entry.entrant.name
    row = BenchRow(set=problem.name, entrant=name, problem=entry.reason)
    if not members:
        return row
    row = row.model_copy(update=_about(members, problem))
    try:
        reports = [_report(arena, entry, member) for member in members]
    except (ControllerFileError, DrivenElsewhere) as error:
        return row.model_copy(update={"problem": str(error)})
    if refused := next((report for report, _ in reports if report.refused), None):
        return row.model_copy(update={"problem": "; ".join(refused.told)})
    rows = [driven for _, driven in reports]
    found = Driven.of(name, rows, runs_of(problem, arena))
    _note(arena, entry, found, rows)
    counts = [each.hidden.count if each.hidden else None for each, _ in reports]
    clocks = [each.clock_dependent for each, _ in reports]
    files = (
        file.model_copy(update={"hidden": count})
        for file, count in zip(row.files, counts, strict=True)
    )
    more = {"files": tuple(files), "clock_dependent": next(filter(None, clocks), None)}
    return row.model_copy(update={**more, **figures_of(found, rows)})


def runs_of(problem: Problem, arena: Arena) -> int:
    """How often each different world of a problem is driven.

    Raises:
        TaskError: Some of them are driven more often than others.
    """
    return problem.runs(arena.split, arena.count) if isinstance(problem, TaskSet) else 1


def _about(members: Sequence[Entrant], problem: Problem) -> dict[str, Any]:
    """What `BenchRow` says of the files of an entrant."""
    steps = [steps_of(member) for member in members]
    return {
        "kind": members[0].kind,
        "knows": knows(members[0], problem),
        "tuned": members[0].tuned,
        "steps": None if None in steps else sum(filter(None, steps)),
        "trained_here": _trained_here(members),
        "files": tuple(BenchFile(sha256=each.sha256) for each in members),
    }


def _trained_here(members: Sequence[Entrant]) -> bool | None:
    """Whether all files record their set, which is then this one."""
    if members[0].kind != "learned":
        return None
    return all(each.saved and each.saved.set_sha256 for each in members)


def _note(arena: Arena, entry: Entry, found: Driven, rows: Rows) -> None:
    """Keeps what an entrant did for tables, figures and the page."""
    name, entrant = entry.problem.name, entry.entrant.name
    if entry.members[0].kind != "privileged":
        arena.driven.setdefault(name, []).append(found)
    arena.rows.extend(world_rows(name, entrant, rows))
    arena.replays.setdefault(name, []).extend(_replays(arena, entry, rows))
    arena.timing.append(_timing(name, entrant, rows))


def folder_of(place: Path, name: str, sha256: str) -> Path:
    """Folder of what a file did on a problem."""
    return place / name / sha256[:16]


def _report(
    arena: Arena, entry: Entry, member: Entrant
) -> tuple[EpisodeReport, tuple[EpisodeRow, ...]]:
    """The report of a file, and its episodes."""
    problem, folder = entry.problem, arena.folder(entry.problem, member)
    report = arena.kept(problem, member)
    if report is None:

        def watch(episodes: int, successes: int) -> None:
            if arena.watch is not None:
                arena.watch(problem.name, entry.entrant.name, episodes, successes)

        watch(0, 0)
        folder.mkdir(parents=True, exist_ok=True)
        request = request_of(member, problem, arena.part(problem), arena.tier)
        report = drive(request, folder, arena.judge, watch)
    if report.episodes or report.refused:
        return report, report.episodes
    return report, sealed_episodes(folder, member.sha256)


def sealed_episodes(folder: Path, sha256: str) -> tuple[EpisodeRow, ...]:
    """The episodes of a file on hidden worlds.

    Args:
        folder: Folder of the file.
        sha256: Hash of the file.

    Raises:
        DrivenElsewhere: They are not there.
    """
    path = folder / SEALED / ROWS_FILE
    if not is_marked(path, hidden=True):
        raise DrivenElsewhere(
            f"the file {sha256[:8]} was driven on these hidden worlds before, and its "
            f"episodes are not in {folder}; tdac bench show puts the folders together"
        )
    lines = read_file(path, RECORD_BYTES).splitlines()
    return tuple(map(EpisodeRow.model_validate_json, lines))


def first_tasks(arena: Arena, problem: Problem) -> dict[int, AnyTask]:
    """The tasks of the episodes that are shown, by number."""
    if not arena.replays.get(problem.name):
        return {}
    numbers = arena.part(problem).numbers[:MOST_WORLDS]
    if isinstance(problem, Task):
        nominal: Any = problem.nominal
        return dict.fromkeys(numbers, nominal)
    return {index: problem.task(arena.split, index) for index in numbers}


def _replays(arena: Arena, entry: Entry, rows: Rows) -> Iterator[Replay]:
    """The first episodes of an entrant's first file, if they may be shown."""
    if arena.split == "hidden":
        return
    folder = arena.folder(entry.problem, entry.members[0])
    for row in rows[0][:MOST_WORLDS]:
        path = folder / TRAJECTORIES / f"{row.number}.npz"
        if path.is_file():
            trajectory = Trajectory.load(path)
            name, number = entry.entrant.name, row.number
            yield Replay(name, number, named(row), row.outcome, trajectory)


def _timing(name: str, entrant: str, rows: Rows) -> dict[str, Any]:
    """The row of `timing.csv`, which differs from one machine to another."""
    steps = sum(each.steps for part in rows for each in part)
    seconds = sum(each.cpu_seconds for part in rows for each in part)
    return {
        "set": name,
        "entrant": entrant,
        "steps": steps,
        "cpu_seconds": round(seconds, 3),
        "ms_per_step": round(1e3 * seconds / max(steps, 1), 3),
    }


def world_rows(name: str, entrant: str, rows: Rows) -> list[dict[str, Any]]:
    """The rows of `worlds.csv`; on a task, `index` is the seed."""
    return [
        {
            "set": name,
            "entrant": entrant,
            "file": number,
            "success": row.success,
            **row.model_dump(exclude={"text", "cpu_seconds", "seed"}),
            "index": row.number,
        }
        for number, own in enumerate(rows)
        for row in own
    ]
