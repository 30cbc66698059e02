"""The entrants of a bench, from the words that the user gives."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from tdac_agent.bench.privileged import PRIVILEGED, check_movers, planner_sha256
from tdac_agent.bench.record import Kind
from tdac_agent.bench.rivals import rival_names, rival_on
from tdac_agent.episodes.sb3_file import POLICY, SavedPolicy
from tdac_agent.errors import ControllerFileError
from tdac_agent.evaluation.policies import (
    BUILTIN,
    entrants_of,
    fitted,
    is_training,
    knowledge,
    not_found,
)
from tdac_agent.problems.episodes import Part, episodes_of
from tdac_agent.storage.files import write_atomic
from tdac_agent.tasks.provenance import sha256_of
from tdac_agent.verification.drive_episodes import Request
from tdac_agent.verification.drive_episodes import drive as drive_request
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.judge.drivers import PolicySpec
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.verify_episodes import written_by
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
        policy: The policy; that of a planner has no file yet.
        source: Source of a planner.
        lineage: Id of the run that wrote the program, if one did.
        saved: What a policy records about its training, if anything.
        tuned: Whether its constants were tuned for the set; None if it has none.
    """

    kind: Kind
    sha256: str
    policy: PolicySpec
    source: bytes | None = None
    lineage: str | None = None
    saved: SavedPolicy | None = None
    tuned: bool | None = None

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
        return Member("privileged", planner_sha256(), PolicySpec("privileged"))
    if word in rival_names():
        rival = rival_on(word, tasks)
        source, spec = rival.source.encode(), PolicySpec("controller")
        return Member("planner", sha256_of(source), spec, source, tuned=rival.tuned)
    (named,) = entrants_of((word,))
    entrant = fitted(named, tasks)
    policy, sha256 = entrant.policy, entrant.sha256
    assert policy.file is not None
    assert sha256 is not None
    if policy.kind == "sb3":
        return Member("learned", sha256, policy, saved=entrant.saved)
    kind: Kind = "builtin" if word == BUILTIN else "controller"
    return Member(kind, sha256, policy, lineage=written_by(policy.file))


def drive(
    member: Member, worlds: Worlds, folder: Path, judge: WarmJudge, watch: Watch
) -> EpisodeReport:
    """Drives a file on worlds.

    Args:
        member: The file.
        worlds: The worlds.
        folder: Folder for the report, and for the episodes.
        judge: A warm judge.
        watch: Called repeatedly with the numbers of episodes and successes so far.

    Raises:
        TaskError: The ledger of hidden evaluations cannot be used.
        Fault: The sandbox is broken.
    """
    with tempfile.TemporaryDirectory(prefix="tdac-bench-") as name:
        policy = member.policy
        if member.source is not None:
            file = Path(name) / "controller.py"
            write_atomic(file, member.source)
            policy = replace(policy, file=file)
        request = Request(
            policy,
            member.sha256,
            episodes_of(worlds.tasks),
            Part(range(worlds.count), worlds.split, worlds.salt_file),
            lineage=member.lineage,
            tier=worlds.tier,
            trajectories=True,
        )
        return drive_request(request, folder, judge, watch)


def knows(member: Member, tasks: TaskSet) -> str:
    """What a file may use."""
    if member.kind == "privileged":
        return "all"
    return knowledge(member.policy, tasks)
