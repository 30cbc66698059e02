"""The drives of a bench as jobs for an executor: one for each file on each set."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from tdac_agent.bench.arena import Arena, Part, is_driven, place_of
from tdac_agent.bench.entrants import Worlds, drive, member_of
from tdac_agent.errors import ControllerFileError
from tdac_agent.executors.executor import Ended, Executor, Reported, Work
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_envs.ladder.task_sets import load_set

Reached = int | None
"""Episodes that reached the goal, or None if the file did not drive."""


@dataclass(frozen=True, slots=True)
class Drive:
    """A file that drives on a set.

    Attributes:
        set: Name of the set, or path of its file.
        named: Name of the set.
        entrant: Name of the entrant.
        word: The file, as for `entrants.named`.
        folder: Folder of what it does.
    """

    set: str
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
    arena: Arena, parts: Sequence[tuple[str | Path, Part]]
) -> Iterator[Drive]:
    """What has not been driven yet; a file that several entrants have, once.

    Args:
        arena: What all entrants share.
        parts: The parts, each with the name or the path of its set.
    """
    seen = set[Path]()
    for given, part in parts:
        for word, member in zip(part.entrant.words, part.members, strict=False):
            folder = place_of(arena, part.tasks, member)
            if folder in seen or is_driven(arena, part.tasks, member):
                continue
            seen.add(folder)
            # Workers have another working folder.
            file = str(Path(word).resolve()) if Path(word).exists() else word
            name = str(Path(given).resolve()) if Path(given).exists() else str(given)
            own = part.tasks.name, part.entrant.name
            yield Drive(name, *own, file, str(folder.resolve()))


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
    tasks, folder = load_set(own.set), Path(own.folder)
    salt = terms["salt_file"]
    worlds = Worlds(
        tasks,
        terms["split"],
        terms["count"],
        None if salt is None else Path(salt),
        terms["tier"],
    )

    def watch(episodes: int, successes: int) -> None:
        tell({"episodes": episodes, "reached": successes})

    try:
        folder.mkdir(parents=True, exist_ok=True)
        report = drive(member_of(own.word, tasks), worlds, folder, judge, watch)
    except ControllerFileError:
        return {"reached": None}
    return {"reached": None if report.refused else report.successes}
