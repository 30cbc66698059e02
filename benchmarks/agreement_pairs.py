"""The controllers of `benchmarks.agreement`, each with the problem that it is for.

Recorded answers and candidates come from `results`; the same text on the same problem
counts once. Controllers of levels with movers are left out, since another physics has
none, and so are the answers of the trial in `results/feedback`, which are unread.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from tdac_agent.evaluation.policies import Entrant, entrant_of, fitted, prepared
from tdac_agent.planners.names import planner_names
from tdac_agent.planners.planner import levels_of
from tdac_agent.prompting.extract import extract_source
from tdac_agent.runs.ownership import load_task
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.tasks.task import Task
from tdac_agent.verification.judge.policy_spec import PolicySpec
from tdac_envs.ladder.task_sets import TaskSet, load_set
from tdac_envs.mapping.bundled import bundled_maps
from tdac_envs.worlds.bundled import bundled_worlds

RESULTS = Path(__file__).parents[1] / "results"
LEVELS = "epuck", "floor", "known", "unknown", "lost"
"""Levels without movers."""
LEARNED = "ppo", "ppo-with-map", "recurrent-ppo"


@dataclass(frozen=True, slots=True)
class Pair:
    """A controller and its problem.

    Attributes:
        controller: Its name.
        family: Who wrote it: candidates of one loop, an answer and its repairs, and
            seeds of one training belong together.
        kind: `answer`, `candidate`, `builtin`, `planner`, `program` or `learned`.
        problem: Name of the task or level.
        is_level: Whether the problem is a level.
        source: Text of a recorded controller; None for what the project has itself.
        word: Otherwise the word for it, as `tdac evaluate` takes it.
    """

    controller: str
    family: str
    kind: str
    problem: str
    is_level: bool
    source: str | None = None
    word: str = ""

    @property
    def name(self) -> str:
        """Name of the pair, unique."""
        return f"{self.controller} on {self.problem}"

    def opened(self) -> Task | TaskSet:
        """The problem."""
        return load_set(self.problem) if self.is_level else load_task(self.problem)

    def entrant(self, problem: Task | TaskSet) -> Entrant:
        """The controller, ready to drive on its problem."""
        if self.source is None:
            return prepared(fitted(entrant_of(self.word, ours=()), problem), problem)[0]
        code = self.source.encode()
        own = Entrant(
            self.name, PolicySpec("controller"), sha256_of(code), "controller"
        )
        return replace(own, source=code)


def all_pairs() -> list[Pair]:
    """All pairs, in an order that does not change."""
    found: list[Pair] = []
    seen: set[tuple[str, bool, str]] = set()
    for pair in (*_of_tasks(), *_of_levels(), *_ours(), *_learned()):
        key = (pair.problem, pair.is_level, pair.source or f"{pair.word} itself")
        if key not in seen:
            seen.add(key)
            found.append(pair)
    names = [pair.name for pair in found]
    assert len(set(names)) == len(names)
    return found


def _of_tasks() -> Iterator[Pair]:
    """Answers to the questions of single tasks."""
    genuine = RESULTS / "genuine"
    for file in sorted(genuine.glob("*/controller.py")):
        task = file.parent.name
        name = f"genuine/{task}"
        text = file.read_text(encoding="utf-8")
        yield Pair(name, name, "answer", task, is_level=False, source=text)
    for reply in sorted(genuine.glob("**/[0-9]*.reply.md")):
        folder = reply.parent
        text = extract_source(reply.read_text(encoding="utf-8"))
        family = str(folder.relative_to(RESULTS))
        name = f"{family}/{reply.name.split('.')[0]}"
        if text is not None:
            yield Pair(name, family, "answer", folder.name, is_level=False, source=text)


def _of_levels() -> Iterator[Pair]:
    """Answers, repairs, candidates and programs that were written for a level."""
    ladder, vision = RESULTS / "ladder", RESULTS / "vision"
    for level in LEVELS:
        for reply in sorted((ladder / "genuine" / level).glob("*/reply.md")):
            own = f"answer {level}-{reply.parent.name}"
            yield from _answer(own, own, level, reply)
        for reply in sorted(vision.glob(f"{level}-*/with*.md")):
            own = reply.parent.name
            yield from _answer(
                f"repair {own} {reply.stem}", f"answer {own}", level, reply
            )
        for folder in sorted((ladder / "loops" / level).glob("*")):
            family = f"loop {level}-{folder.name}"
            for file in sorted(folder.glob("iterations/*/*/controller.py")):
                k, j = file.parts[-3:-1]
                yield Pair(
                    f"{family} {k}{j}", family, "candidate", level, is_level=True,
                    source=file.read_text(encoding="utf-8"),
                )  # fmt: skip
        for file in sorted((ladder / "programs" / level).glob("*/controller.py")):
            name = f"program {file.parent.name}"
            text = file.read_text(encoding="utf-8")
            yield Pair(name, name, "program", level, is_level=True, source=text)


def _answer(name: str, family: str, level: str, reply: Path) -> Iterator[Pair]:
    text = extract_source(reply.read_text(encoding="utf-8"))
    if text is not None:
        yield Pair(name, family, "answer", level, is_level=True, source=text)


def _ours() -> Iterator[Pair]:
    """`builtin` everywhere, and the planners on their levels."""
    for level in LEVELS:
        own = f"builtin {level}"
        yield Pair(own, own, "builtin", level, is_level=True, word="builtin")
        for name in planner_names():
            if level in levels_of(name):
                yield Pair(name, name, "planner", level, is_level=True, word=name)
    worlds = ["epuck", *(f"epuck-{w}" for w in bundled_worlds() if w != "arena")]
    for robot, tasks in (("map", bundled_maps()), ("e-puck", worlds)):
        for task in tasks:
            name = f"builtin {robot}"
            yield Pair(name, name, "builtin", task, is_level=False, word="builtin")


def _learned() -> Iterator[Pair]:
    """Policies that learned on a level, with all their seeds."""
    for algo in LEARNED:
        for level in LEVELS:
            for folder in sorted(
                (RESULTS / "ladder/learned").glob(f"{algo}-{level}-?")
            ):
                yield Pair(
                    folder.name, f"{algo} {level}", "learned", level, is_level=True,
                    word=str(folder),
                )  # fmt: skip
