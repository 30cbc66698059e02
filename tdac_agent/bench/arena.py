"""Drives the entrants of a bench, each on each set."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tdac_agent.bench.compared import Driven, Episodes, figures_of
from tdac_agent.bench.entrants import Member, Named, Worlds, drive, knows, member_of
from tdac_agent.bench.page import MOST_WORLDS, Replay
from tdac_agent.bench.record import BenchFile, BenchRow
from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.errors import ControllerFileError, RunError
from tdac_agent.evaluation.kept_sets import ROWS_FILE, TRAJECTORIES, kept_report
from tdac_agent.evaluation.salt import SEALED
from tdac_agent.evaluation.set_report import SetReport
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.verification.judge.set_job import WorldEpisode
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_envs.core.errors import TaskError
from tdac_envs.core.intake import RECORD_BYTES, read_file
from tdac_envs.ladder.source import read_salt
from tdac_envs.ladder.task_sets import AnyTask, TaskSet

DRIVEN = "driven"
"""Folder with what each file did on each set; of hidden worlds, it is in `sealed`."""
Watch = Callable[[str, str, int, int], None]


@dataclass(frozen=True, slots=True)
class Part:
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
class Arena:
    """What all entrants share, and what they did.

    Attributes:
        split: Split of the worlds.
        count: Number of worlds of each set.
        salt_file: File with the salt of hidden worlds.
        tier: Sandbox tier.
        out: Folder of the results.
        judge: A warm judge.
        watch: Called with set, entrant, episodes and successes so far.
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
    driven: dict[str, list[Driven]] = field(default_factory=dict)
    rows: list[dict[str, Any]] = field(default_factory=list)
    timing: list[dict[str, Any]] = field(default_factory=list)
    replays: dict[str, list[Replay]] = field(default_factory=dict)

    @property
    def salt_sha256(self) -> str | None:
        """Hash of the salt of hidden worlds."""
        return None if self.salt_file is None else sha256_of(read_salt(self.salt_file))


class DrivenElsewhere(RunError):
    """The ledger has the result of a file, but its episodes are in another folder."""


def part_of(entrant: Named, tasks: TaskSet) -> Part:
    """The files of an entrant for a set, or why there are none."""
    try:
        members = tuple(member_of(word, tasks) for word in entrant.words)
    except (TaskError, ControllerFileError) as error:
        return Part(tasks, entrant, problem=str(error))
    kinds = dict.fromkeys(m.saved.algo if m.saved else m.kind for m in members)
    if len(kinds) > 1:
        problem = f"its files are not seeds of one training: {', '.join(kinds)}"
        return Part(tasks, entrant, problem=problem)
    if len({member.sha256 for member in members}) < len(members):
        return Part(tasks, entrant, problem="two of its files are the same")
    return Part(tasks, entrant, members)


def row_of(arena: Arena, part: Part) -> BenchRow:
    """Drives an entrant on a set, unless it has been driven already."""
    members, tasks = part.members, part.tasks
    row = BenchRow(set=tasks.name, entrant=part.entrant.name, problem=part.problem)
    if not members:
        return row
    row = row.model_copy(update=_about(members, tasks))
    try:
        reports = [_report(arena, part, member) for member in members]
    except (ControllerFileError, DrivenElsewhere) as error:
        return row.model_copy(update={"problem": str(error)})
    if refused := next((report for report, _ in reports if report.refused), None):
        return row.model_copy(update={"problem": "; ".join(refused.told)})
    episodes = [driven for _, driven in reports]
    runs = tasks.runs(arena.split, arena.count)
    found = Driven.of(part.entrant.name, episodes, runs)
    _note(arena, part, found, episodes)
    counts = [each.hidden.count if each.hidden else None for each, _ in reports]
    clocks = [each.clock_dependent for each, _ in reports]
    files = (
        file.model_copy(update={"hidden": count})
        for file, count in zip(row.files, counts, strict=True)
    )
    more = {"files": tuple(files), "clock_dependent": next(filter(None, clocks), None)}
    return row.model_copy(update={**more, **figures_of(found, episodes)})


def _about(members: Sequence[Member], tasks: TaskSet) -> dict[str, Any]:
    """What `BenchRow` says of the files of an entrant."""
    steps = [member.steps for member in members]
    return {
        "kind": members[0].kind,
        "knows": knows(members[0], tasks),
        "tuned": members[0].tuned,
        "steps": None if None in steps else sum(filter(None, steps)),
        "files": tuple(BenchFile(sha256=each.sha256) for each in members),
    }


def _note(arena: Arena, part: Part, found: Driven, episodes: Episodes) -> None:
    """Keeps what an entrant did for tables, figures and the page."""
    name, entrant = part.tasks.name, part.entrant.name
    if part.members[0].kind != "privileged":
        arena.driven.setdefault(name, []).append(found)
    arena.rows.extend(world_rows(name, entrant, episodes))
    arena.replays.setdefault(name, []).extend(_replays(arena, part, episodes))
    arena.timing.append(_timing(name, entrant, episodes))


def folder_of(place: Path, name: str, sha256: str) -> Path:
    """Folder of what a file did on a set."""
    return place / name / sha256[:16]


def place_of(arena: Arena, tasks: TaskSet, member: Member) -> Path:
    """Folder of what a file does on a set in this arena."""
    place = SEALED if arena.split == "hidden" else DRIVEN
    return folder_of(arena.out / place, tasks.name, member.sha256)


def is_driven(arena: Arena, tasks: TaskSet, member: Member) -> bool:
    """Whether a file has driven on all worlds of a set."""
    return _kept(arena, tasks, member) is not None


def _kept(arena: Arena, tasks: TaskSet, member: Member) -> SetReport | None:
    folder, own = place_of(arena, tasks, member), (member.sha256, tasks.sha256)
    return kept_report(folder, *own, arena.split, arena.count, arena.salt_sha256)


def _report(
    arena: Arena, part: Part, member: Member
) -> tuple[SetReport, tuple[WorldEpisode, ...]]:
    """The report of a file, and its episodes."""
    tasks, folder = part.tasks, place_of(arena, part.tasks, member)
    report = _kept(arena, tasks, member)
    if report is None:

        def watch(episodes: int, successes: int) -> None:
            if arena.watch is not None:
                arena.watch(tasks.name, part.entrant.name, episodes, successes)

        watch(0, 0)
        folder.mkdir(parents=True, exist_ok=True)
        own = tasks, arena.split, arena.count, arena.salt_file, arena.tier
        report = drive(member, Worlds(*own), folder, arena.judge, watch)
    if report.episodes or report.refused:
        return report, report.episodes
    return report, sealed_episodes(folder, member.sha256)


def sealed_episodes(folder: Path, sha256: str) -> tuple[WorldEpisode, ...]:
    """The episodes of a file on hidden worlds.

    Args:
        folder: Folder of the file.
        sha256: Hash of the file.

    Raises:
        DrivenElsewhere: They are not there.
    """
    path = folder / SEALED / ROWS_FILE
    try:
        lines = read_file(path, RECORD_BYTES).splitlines()
    except OSError:
        raise DrivenElsewhere(
            f"the file {sha256[:8]} was driven on these hidden worlds before, and its "
            f"episodes are not in {folder}; tdac bench show puts the folders together"
        ) from None
    return tuple(map(WorldEpisode.model_validate_json, lines))


def first_tasks(arena: Arena, tasks: TaskSet) -> dict[int, AnyTask]:
    """The tasks of the worlds whose episodes are shown."""
    if not arena.replays.get(tasks.name):
        return {}
    count = min(arena.count, MOST_WORLDS)
    return {index: tasks.task(arena.split, index) for index in range(count)}


def _replays(arena: Arena, part: Part, episodes: Episodes) -> Iterator[Replay]:
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
