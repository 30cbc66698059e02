"""The entrants of a bench, from the words that the user gives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from tdac_agent.bench.privileged import (
    PRIVILEGED,
    check_movers,
    plan_worlds,
    planner_sha256,
)
from tdac_agent.bench.record import Kind
from tdac_agent.bench.rivals import rival_names, rival_on
from tdac_agent.episodes.sb3_file import POLICY, SavedPolicy
from tdac_agent.errors import ControllerFileError
from tdac_agent.evaluation.entrants import BUILTIN, Entrant, is_training, not_found
from tdac_agent.evaluation.set_entrants import set_entrants
from tdac_agent.evaluation.set_learned import LearnedRuns
from tdac_agent.evaluation.set_report import SetReport
from tdac_agent.evaluation.set_verify import verify_on_set, written_by
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.verify import read_source
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.task_sets import TaskSet

Watch = Callable[[int, int], None]


@dataclass(frozen=True, slots=True)
class Worlds:
    """The worlds on which all entrants drive.

    Attributes:
        tasks: The task set.
        split: `dev`, `test` or `hidden`.
        count: Number of worlds, from world 0 on.
        salt_file: File with the salt of hidden worlds.
        tier: Sandbox tier.
    """

    tasks: TaskSet
    split: str
    count: int
    salt_file: Path | None = None
    tier: str = "auto"


@dataclass(frozen=True, slots=True)
class Named:
    """An entrant as the user names it.

    Attributes:
        name: Its name in results.
        words: A file, the folder of a run or training, or the name of a program of
            ours; several are policies that were trained alike with several seeds.
    """

    name: str
    words: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Member:
    """A file that drives on a set.

    Attributes:
        kind: `builtin`, a classical `planner`, any other `controller`, `learned` with
            stable-baselines3, or `privileged`, a planner that knows the true world.
        sha256: Its hash.
        source: The file, if it is a program.
        lineage: Id of the run that wrote the program, if one did.
        learned: The policy, if it was trained with stable-baselines3.
        tuned: Whether its constants were tuned for the set; None if it has none.
    """

    kind: Kind
    sha256: str
    source: bytes | None = None
    lineage: str | None = None
    learned: Entrant | None = None
    tuned: bool | None = None

    @property
    def saved(self) -> SavedPolicy | None:
        """What a policy records about its training, if anything."""
        return None if self.learned is None else self.learned.saved

    @property
    def steps(self) -> int | None:
        """Steps of its training, if they are known."""
        return None if self.saved is None else self.saved.steps


def named(words: Sequence[str]) -> tuple[Named, ...]:
    """The entrants for words such as `builtin`, `dwa`, `mine.py`, `ppo=a.zip,b.zip`.

    Raises:
        TaskError: There is none, a name is given twice, or one is not printable.
        ControllerFileError: A file is missing, or is neither controller nor policy.
    """
    found = tuple(map(_named, words))
    if not found:
        raise TaskError("expected at least one entrant")
    names = [each.name for each in found]
    for name in names:
        if not name.isprintable():
            raise TaskError(f"expected printable names of entrants, got {name!r:.80}")
        if names.count(name) > 1:
            raise TaskError(f"the entrant {name!r} is given twice: name it, NAME=FILE")
    for each in found:
        if not each.name or not each.words:
            raise TaskError(f"expected NAME=FILE, got {each.name!r} and {each.words}")
        for word in each.words:
            if word not in (*rival_names(), PRIVILEGED):
                _check(word)
    return found


def _named(word: str) -> Named:
    name, equals, files = word.partition("=")
    if not equals or Path(word).exists():
        path = Path(word).absolute()
        # Every training calls its policy the same.
        return Named(path.parent.name if path.name == POLICY else path.name, (word,))
    return Named(name, tuple(file for file in files.split(",") if file))


def _check(word: str) -> None:
    """Finds early that there is no such file.

    A broken one is no error of the bench: it becomes a row with the reason.

    Raises:
        ControllerFileError: There is none.
    """
    path = Path(word)
    given = path, path / "controller.py"
    if word == BUILTIN or is_training(path) or any(map(Path.is_file, given)):
        return
    if path.is_dir():
        raise ControllerFileError(
            f"no entrant in the folder {word}: it has neither controller.py nor a "
            f"{POLICY} of tdac train"
        )
    raise ControllerFileError(not_found("entrant", word, (BUILTIN, *rival_names())))


def member_of(word: str, tasks: TaskSet) -> Member:
    """The file that drives for a word on a set.

    Raises:
        TaskError: There is none for this set.
        ControllerFileError: It is broken, or was trained elsewhere.
    """
    if word == PRIVILEGED:
        check_movers(tasks)
        return Member("privileged", planner_sha256())
    if word in rival_names():
        rival = rival_on(word, tasks)
        source = rival.source.encode()
        return Member("planner", sha256_of(source), source, tuned=rival.tuned)
    (entrant,) = set_entrants((word,), tasks)
    file, sha256 = entrant.policy.file, entrant.sha256
    assert file is not None
    assert sha256 is not None
    if entrant.policy.kind == "sb3":
        return Member("learned", sha256, learned=entrant)
    kind: Kind = "builtin" if word == BUILTIN else "controller"
    return Member(kind, sha256, read_source(file), written_by(file))


def drive(
    member: Member, worlds: Worlds, folder: Path, judge: WarmJudge, watch: Watch
) -> SetReport:
    """Drives a file on worlds.

    Args:
        member: The file.
        worlds: The worlds.
        folder: Folder for the report, and for the episodes.
        judge: A warm judge.
        watch: Called repeatedly with the numbers of episodes and successes so far.

    Raises:
        ControllerFileError: A policy does not fit what is observed.
        TaskError: The ledger of hidden evaluations cannot be used.
        Fault: The sandbox is broken.
    """
    salt_file = worlds.salt_file
    if member.kind == "privileged":
        own = worlds.tasks, worlds.split, worlds.count, salt_file
        report = plan_worlds(*own, folder)
        watch(report.worlds, report.successes)
        return report
    if member.learned is not None:
        runs = LearnedRuns.of(member.learned, worlds.tasks, worlds.split, salt_file)
        return runs.report(worlds.count, folder, watch)
    assert member.source is not None
    return verify_on_set(
        member.source,
        worlds.tasks,
        worlds.split,
        worlds.count,
        salt_file=salt_file,
        lineage=member.lineage,
        tier=worlds.tier,
        out=folder,
        judge=judge,
        watch=watch,
    )


def knows(member: Member, tasks: TaskSet) -> str:
    """What a file may use."""
    if member.kind == "privileged":
        return "all"
    if member.learned is None:
        return "+ map" if tasks.file.map else "sensors"
    return "+ map" if "map-view" in member.learned.policy.wrappers else "sensors"
