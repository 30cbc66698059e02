"""Drives a learned policy on worlds of a task set, with its sensors alone."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tdac_agent.episodes.episode import Record, not_driven, run_policy
from tdac_agent.episodes.learned import Learned
from tdac_agent.episodes.trajectory import Rollout
from tdac_agent.errors import ControllerFileError
from tdac_agent.evaluation.entrants import Entrant
from tdac_agent.evaluation.kept_sets import (
    ROWS_FILE,
    TRAJECTORIES,
    keep_report,
    keep_sealed,
    keep_trajectories,
    unfinished,
)
from tdac_agent.evaluation.ledger import HiddenEvaluation, on_record
from tdac_agent.evaluation.set_report import SetProvenance, SetReport, summarise
from tdac_agent.evaluation.set_verify import write_set
from tdac_agent.sandbox import ControllerFault
from tdac_agent.tasks.provenance import sha256_of, versions
from tdac_agent.verification.judge.driving import FOREVER
from tdac_agent.verification.judge.set_job import (
    WorldEpisode,
    figures_of,
    kept_worlds,
)
from tdac_envs.ladder.env import TaskSetEnv, make
from tdac_envs.ladder.source import read_salt
from tdac_envs.ladder.task_sets import TaskSet


@dataclass(frozen=True, slots=True, eq=False)
class LearnedRuns:
    """A learned policy and the environment in which it drives.

    Attributes:
        entrant: The policy.
        tasks: The task set.
        split: `dev`, `test` or `hidden`.
        salt: The salt of the split `hidden`.
        env: The judge's environment; the policy gets its observations alone.
    """

    entrant: Entrant
    tasks: TaskSet
    split: str
    salt: bytes | None
    env: TaskSetEnv

    @classmethod
    def of(
        cls,
        entrant: Entrant,
        tasks: TaskSet,
        split: str,
        salt_file: Path | None = None,
    ) -> LearnedRuns:
        """Prepares the episodes.

        Raises:
            ControllerFileError: The policy does not fit what the set observes.
        """
        with tempfile.TemporaryDirectory(prefix="tdac-set-") as name:
            level = write_set(tasks, Path(name) / "set.yaml")
            env = make(level, split=split, salt_file=salt_file, privileged=True)
        salt = None if salt_file is None else read_salt(salt_file)
        runs = cls(entrant, tasks, split, salt, env)
        try:
            runs._driver()
        except ControllerFault as fault:
            raise ControllerFileError(f"{entrant.name}: {fault}") from fault
        return runs

    def report(
        self,
        worlds: int,
        out: Path | None = None,
        watch: Callable[[int, int], None] | None = None,
    ) -> SetReport:
        """Drives on the first worlds of the split.

        An evaluation on hidden worlds is recorded as `verify_on_set` records it.

        Args:
            worlds: Number of worlds.
            out: Folder for `set.json` and `trajectories/`; of hidden worlds, for
                `set.json` and `sealed/`.
            watch: Called with the numbers of episodes and successes so far.

        Raises:
            TaskError: The ledger of hidden evaluations cannot be used.
        """
        assert self.entrant.sha256 is not None
        if self.salt is None:
            return self._driven(worlds, out, watch)
        about = HiddenEvaluation(
            entrant=self.entrant.sha256,
            set=self.tasks.name,
            set_sha256=self.tasks.sha256,
            worlds=worlds,
            salt_sha256=sha256_of(self.salt),
        )
        report = on_record(about, None, lambda: self._driven(worlds, out, watch))
        if out is not None:
            keep_report(report, out)
        return report

    def _driven(
        self,
        worlds: int,
        out: Path | None,
        watch: Callable[[int, int], None] | None,
    ) -> SetReport:
        began = time.monotonic()
        assert self.entrant.sha256 is not None
        per_world, wrappers = self.salt is None, self.entrant.policy.wrappers
        about = {
            "policy": [self.entrant.sha256, wrappers],
            "set": self.tasks.sha256,
            "worlds": [self.split, worlds],
            "secret": None if self.salt is None else sha256_of(self.salt),
            "versions": dict(versions()),
        }
        with unfinished(out, about) as driven:
            episodes = self._episodes(worlds, driven, watch)
            if per_world and out is not None and driven is not None:
                keep_trajectories(driven / TRAJECTORIES, out)
        provenance = SetProvenance.unconfined(
            self.tasks, self.split, self.salt, self.entrant.sha256
        )
        seconds = time.monotonic() - began
        different = self.tasks.different(self.split)
        report = summarise(
            provenance,
            episodes,
            None,
            seconds,
            per_world=per_world,
            different=different,
        )
        if out is not None and per_world:
            keep_report(report, out)
        elif out is not None:
            keep_sealed(episodes, out)
        return report

    def _episodes(
        self,
        worlds: int,
        kept: Path | None,
        watch: Callable[[int, int], None] | None,
    ) -> list[WorldEpisode]:
        """Drives the worlds that an interrupted call has not driven."""
        rows = None if kept is None else kept / ROWS_FILE
        episodes = kept_worlds(rows, tuple(range(worlds)))
        per_world = self.salt is None
        for index in range(len(episodes), worlds):
            before = time.process_time()
            rollout = self.drive(index)
            cpu = time.process_time() - before
            if kept is not None and per_world:
                (kept / TRAJECTORIES).mkdir(exist_ok=True)
                rollout.trajectory.save(kept / TRAJECTORIES / f"{index}.npz")
            found = figures_of(
                self.env, self.split, index, rollout, cpu, per_world=per_world
            )
            episodes.append(found)
            if rows is not None:
                with rows.open("a", encoding="utf-8") as file:
                    file.write(f"{found.model_dump_json()}\n")
            if watch is not None:
                watch(len(episodes), sum(each.success for each in episodes))
        return episodes

    def drive(self, index: int) -> Rollout:
        """Drives the episode of a world."""
        name = f"world {index}"
        record = Record(self.env, None, FOREVER, options={"index": index})
        try:
            driver = self._driver()
        except ControllerFault as fault:
            return not_driven(record, name, fault)
        return run_policy(driver, record, name, held_out=False, deadline=math.inf)

    def _driver(self) -> Learned:
        policy = self.entrant.policy
        assert policy.file is not None
        return Learned(policy.file, policy.wrappers, self.env)
