"""The drives of a bench as jobs for an executor: one for each file on each set."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from tdac_agent.bench.arena import Arena, Entry
from tdac_agent.bench.entrants import member_of, request_of
from tdac_agent.errors import ControllerFileError
from tdac_agent.evaluation.evaluate import part_of
from tdac_agent.executors.executor import Ended, Executor, Reported, Work
from tdac_agent.runs.ownership import load_task
from tdac_agent.tasks.task import Task
from tdac_agent.verification.drive_episodes import drive
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_envs.ladder.task_sets import load_set

Reached = int | None
"""Episodes that reached the goal, or None if the file did not drive."""


@dataclass(frozen=True, slots=True)
class Drive:
    """A file that drives on a task or a set.

    Attributes:
        set: Name of the task or set, or path of its file.
        is_task: Whether it is a task.
        named: Its name.
        entrant: Name of the entrant.
        word: The file, as for `entrants.named`.
        folder: Folder of what it does.
    """

    set: str
    is_task: bool
    named: str
    entrant: str
    word: str
    folder: str

    @property
    def name(self) -> str:
        """Its folder, which no other one has."""
        return self.folder

    def to_json(self) -> str:
        """The drive on one line."""
        return json.dumps(asdict(self))


def drives_of(
    arena: Arena, entries: Sequence[tuple[str | Path, Entry]]
) -> Iterator[Drive]:
    """What has not been driven yet; a file that several entrants have, once.

    Args:
        arena: What all entrants share.
        entries: The entries, each with the name or the path of its task or set.
    """
    seen = set[Path]()
    for given, entry in entries:
        problem = entry.problem
        for word, member in zip(entry.entrant.words, entry.members, strict=False):
            folder = arena.folder(problem, member)
            if folder in seen or arena.kept(problem, member) is not None:
                continue
            seen.add(folder)
            yield Drive(
                set=_absolute(given),
                is_task=isinstance(problem, Task),
                named=problem.name,
                entrant=entry.entrant.name,
                word=_absolute(word),
                folder=str(folder.resolve()),
            )


def _absolute(word: str | Path) -> str:
    """A path for workers, which have another working folder; else the word."""
    return str(Path(word).resolve()) if Path(word).exists() else str(word)


def drive_all(
    arena: Arena,
    drives: Iterator[Drive],
    executor: Executor[Reached, Drive],
    workers: int,
) -> None:
    """Executes drives. A problem is not raised here: `row_of` meets it again."""
    salt = arena.salt_file
    terms = {
        "split": arena.split,
        "count": arena.count,
        "salt_file": None if salt is None else str(salt.resolve()),
        "tier": arena.tier,
        "physics": arena.physics,
    }
    work = Work(
        module=__name__,
        terms=terms,
        workers=workers,
        folder=arena.out,
        read=lambda found: found["reached"],
        failed=lambda *_: None,
    )
    with closing(executor(work, lambda: next(drives, None))) as updates:
        for update in updates:
            if isinstance(update, Reported):
                done, reached = update.record["episodes"], update.record["reached"]
            elif isinstance(update, Ended) and update.outcome is not None:
                done, reached = arena.count, update.outcome
            else:
                continue
            if arena.watch is not None:
                arena.watch(update.job.named, update.job.entrant, done, reached)


def perform_job(
    job: str,
    terms: dict[str, Any],
    judge: WarmJudge,
    tell: Callable[[dict[str, Any]], None],
) -> dict[str, Any]:
    """Drives for an executor; see `executors.executor.Work`."""
    own = Drive(**json.loads(job))
    problem = load_task(own.set) if own.is_task else load_set(own.set)
    folder, salt = Path(own.folder), terms["salt_file"]

    def watch(episodes: int, successes: int) -> None:
        tell({"episodes": episodes, "reached": successes})

    part = replace(
        part_of(
            problem,
            terms["count"],
            split=terms["split"],
            salt_file=None if salt is None else Path(salt),
        ),
        physics=terms["physics"],
    )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        member = member_of(own.word, problem)
        request = request_of(member, problem, part, terms["tier"])
        report = drive(request, folder, judge, watch)
    except ControllerFileError:
        return {"reached": None}
    return {"reached": None if report.refused else report.successes}
