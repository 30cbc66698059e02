"""Drives a policy with deviations in the judge; each case at most once."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Protocol

from tdac_agent.problems.episodes import episodes_of
from tdac_agent.problems.part import Part, identity_of
from tdac_agent.tasks.deviation import Deviation
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.provenance import versions
from tdac_agent.tasks.task import Task
from tdac_agent.verification.judge.deviated import placed, shifted_env, start_of
from tdac_agent.verification.judge.episode_job import EpisodeJob
from tdac_agent.verification.judge.episode_row import EpisodeRow
from tdac_agent.verification.judge.policy_spec import PolicySpec, written
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.judge.worlds import (
    Case,
    DeviatedWorlds,
    SetWorlds,
    TaskWorld,
)
from tdac_agent.verification.run_episodes import run_episodes
from tdac_agent.verification.store import ROWS_FILE, mark_rows, unfinished
from tdac_envs.core.errors import TaskError
from tdac_envs.core.intake import read_file
from tdac_envs.ladder.task_sets import TaskSet
from tdac_envs.physics.moved import EXACT

JITTER = "jitter"
_MOST_BYTES = 64 << 20
Watch = Callable[[int], None]


class Searched(Protocol):
    """A policy that is searched for failures, ready to drive."""

    @property
    def name(self) -> str:
        """Its name in records."""

    @property
    def policy(self) -> PolicySpec:
        """The policy for the judge."""

    @property
    def sha256(self) -> str:
        """Hash of its file."""

    @property
    def source(self) -> bytes | None:
        """Source of a program; None to read its file."""

    @property
    def weights(self) -> bytes | None:
        """Content of its weights, if it has any."""


@dataclass(slots=True)
class Drives:
    """Episodes with deviations, each driven at most once.

    Attributes:
        entrant: Who drives.
        problem: Where.
        split: Split of a set.
        budget: Most episodes; beyond them nothing is driven.
        about: What determines the episodes.
        tier: Sandbox tier.
        out: Folder that keeps what an interrupted search has driven; None for none.
        judge: A warm judge.
        watch: Called with the number of episodes so far.
        physics: What moves the robot.
        used: Tier that the sandbox had.
        count: Episodes so far, those of an interrupted search included.
    """

    entrant: Searched
    problem: Task | TaskSet
    split: str
    budget: int
    about: dict[str, Any]
    tier: str
    out: Path | None
    judge: WarmJudge
    watch: Watch | None = None
    physics: str = EXACT
    used: str = ""
    count: int = 0
    _known: dict[str, EpisodeRow] = field(default_factory=dict)
    _asked: set[str] = field(default_factory=set)
    _possible: dict[str, bool] = field(default_factory=dict)
    _stack: ExitStack = field(default_factory=ExitStack)
    _kept: Path | None = None
    _folder: Path = Path()

    def __enter__(self) -> Drives:
        name = self._stack.enter_context(
            # A judge that is interrupted may still be writing there.
            tempfile.TemporaryDirectory(
                prefix="tdac-falsify-", ignore_cleanup_errors=True
            )
        )
        self._folder = Path(name)
        about = {
            **self.about,
            "policy": [self.entrant.policy.kind, self.entrant.sha256],
            "problem": identity_of(episodes_of(self.problem)),
            "split": self.split,
            "tier": self.tier,
            "physics": self.physics,
            "versions": dict(versions()),
        }
        self._kept = self._stack.enter_context(unfinished(self.out, about))
        if self._kept is not None and (self._kept / ROWS_FILE).is_file():
            text = read_file(self._kept / ROWS_FILE, _MOST_BYTES)
            for line in text.splitlines(keepends=True):
                if not line.endswith(b"\n"):  # it was not written completely
                    break
                kept = json.loads(line)
                row = EpisodeRow.model_validate(kept["row"])
                self._known[kept["case"]] = row
        return self

    def __exit__(self, *error: Any) -> None:
        self.judge.end_series()
        self._stack.__exit__(*error)

    @property
    def left(self) -> int:
        """Episodes that may still be driven."""
        return self.budget - self.count

    def is_possible(self, deviation: Deviation) -> bool:
        """Whether an episode can begin with shifted start and obstacles."""
        if not isinstance(self.problem, Task):
            return True
        own = placed(deviation)
        key = _key(Case(number=0, deviation=own))
        if key not in self._possible:
            self._possible[key] = not own.parts() or self._begins(own)
        return self._possible[key]

    def _begins(self, deviation: Deviation) -> bool:
        assert isinstance(self.problem, Task)
        try:
            env = shifted_env(self.problem, deviation, Disturbance.none())
            start = start_of(self.problem.nominal, deviation)
            env.reset(seed=0, options={"start": start})
        except TaskError:
            return False
        return True

    def drive(
        self,
        cases: Sequence[Case],
        variation: str = "nominal",
    ) -> list[EpisodeRow | None]:
        """The rows of some cases, which must be possible; None beyond the budget.

        Args:
            cases: The cases.
            variation: Variation of the start of a task.
        """
        keys = [f"{variation} {_key(each)}" for each in cases]
        new = [key for key in dict.fromkeys(keys) if key not in self._asked]
        granted = set(new[: max(0, self.left)])
        self._asked |= granted
        self.count += len(granted)
        wanted = {
            key: case
            for key, case in zip(keys, cases, strict=True)
            if key in self._asked and key not in self._known
        }
        if wanted:
            self._run(wanted, variation)
        if self.watch is not None:
            self.watch(self.count)
        return [self._known[key] if key in self._asked else None for key in keys]

    def _run(self, wanted: dict[str, Case], variation: str) -> None:
        own, cases = episodes_of(self.problem), tuple(wanted.values())
        job = EpisodeJob(
            worlds=DeviatedWorlds(within=self._within(variation), cases=cases),
            policy=written(
                self.entrant.policy,
                self._folder,
                self.entrant.source,
                self.entrant.weights,
            ),
            numbers=tuple(range(len(cases))),
            tier=self.tier,
            limits=own.limits,
            out=self._folder / f"results-{len(self._known)}",
            series=True,
        )
        series = f"{variation} of {self._folder}"
        rows, ending = run_episodes(job, own.longest, self.judge, series=series)
        self.used = ending.tier
        for key, row in zip(wanted, rows, strict=True):
            self._known[key] = row
        if self._kept is not None:
            with (self._kept / ROWS_FILE).open("a", encoding="utf-8") as file:
                for key in wanted:
                    kept = self._known[key].model_dump(mode="json")
                    file.write(json.dumps({"case": key, "row": kept}) + "\n")
            mark_rows(self._kept)

    def _within(self, variation: str) -> TaskWorld | SetWorlds:
        folder = self._folder / f"world-{variation}"
        folder.mkdir(exist_ok=True)
        part = Part(
            (0,),
            self.split,
            disturbance=named_disturbance(self.problem),
            variation=variation,
            physics=self.physics,
        )
        return episodes_of(self.problem).worlds(part, folder, self.entrant.policy)


def named_disturbance(problem: Task | TaskSet) -> Disturbance | None:
    """What disturbs all episodes of a task: only what it names. A set has its own."""
    if not isinstance(problem, Task):
        return None
    if problem.says_disturbances:
        return problem.own_disturbance()
    return Disturbance.none()


def _key(case: Case) -> str:
    """A case as text, the same on all machines."""
    return json.dumps([case.number, asdict(case.deviation)])
