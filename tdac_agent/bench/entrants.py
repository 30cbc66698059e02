"""The entrants of a bench, from the words that the user gives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tdac_agent.episodes.sb3_file import POLICY
from tdac_agent.errors import ControllerFileError
from tdac_agent.evaluation.policies import (
    BUILTIN,
    FOLLOWER,
    PRIVILEGED,
    Entrant,
    entrant_of,
    fitted,
    is_training,
    knowledge,
    not_found,
    prepared,
)
from tdac_agent.planners.names import planner_names
from tdac_agent.problems.episodes import episodes_of
from tdac_agent.problems.part import Part
from tdac_agent.tasks.task import Task
from tdac_agent.verification.drive_episodes import Request
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.task_sets import TaskSet


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
            if word not in (*planner_names(), PRIVILEGED, FOLLOWER):
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
    raise ControllerFileError(not_found("entrant", word, (BUILTIN, *planner_names())))


def member_of(word: str, problem: Task | TaskSet) -> Entrant:
    """The policy that drives for a word on a problem.

    Raises:
        TaskError: There is none for this problem.
        ControllerFileError: It is broken, or was trained elsewhere.
    """
    return prepared(fitted(entrant_of(word, ours=()), problem), problem)[0]


def steps_of(member: Entrant) -> int | None:
    """Steps of the training of a policy, if they are known."""
    return None if member.saved is None else member.saved.steps


def request_of(
    member: Entrant, problem: Task | TaskSet, part: Part, tier: str
) -> Request:
    """What the judge is to drive."""
    return Request(
        member.policy,
        member.sha256,
        episodes_of(problem),
        part,
        member.source,
        lineage=member.lineage,
        tier=tier,
        trajectories=True,
        weights=member.weights,
    )


def knows(member: Entrant, problem: Task | TaskSet) -> str:
    """What a policy may use."""
    if member.kind == PRIVILEGED:
        return "all"
    return knowledge(member.policy, problem)
