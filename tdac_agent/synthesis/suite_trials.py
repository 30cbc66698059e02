"""Trials on a task: its suite tests candidates, and disturbed episodes compare them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from functools import cached_property
from queue import SimpleQueue

from tdac_agent.runs.improvement_record import (
    IMPROVEMENT_FILE,
    drive_text,
    goals_text,
)
from tdac_agent.runs.run_record import Confirmation, Status
from tdac_agent.storage.files import write_atomic
from tdac_agent.synthesis.archive import Archive
from tdac_agent.synthesis.candidates import Candidate, Explored, Result
from tdac_agent.synthesis.confirming import (
    confirmed_result,
    drive_blind,
    keep_confirmation,
)
from tdac_agent.synthesis.delivery import (
    compared,
    place_verified,
    task_improvement,
)
from tdac_agent.synthesis.disturbed import (
    reached_of,
    seeds_for,
    successes_of,
    task_figures,
    time_of,
)
from tdac_agent.synthesis.driving import drive_candidate
from tdac_agent.synthesis.pool_feedback import PoolFeedback
from tdac_agent.synthesis.terms import Chosen, Terms
from tdac_agent.synthesis.tested import failed_tests, recorded_report, suite_result
from tdac_agent.tasks.task import Task
from tdac_agent.verification.diagnosis.report import Report
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.judge.episode_row import EpisodeRow
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.suite_check import prove_suite
from tdac_agent.verification.verdict import confirmed_text, is_verified
from tdac_agent.verification.verify import kept_report, verify

POOL = "improve"
"""Episodes of a race, and their folders inside that of a candidate."""


class SuiteTrials:
    """See `Trials`.

    Args:
        task: The task.
        terms: What all tests share.
    """

    status: Status = "passed"
    ended = ""
    needs_new_code = False
    tests_left = None
    aim = (
        "What counts is the number of goals reached in disturbed episodes that nobody "
        "has seen yet, and then the mean time score. All tests must still pass."
    )

    def __init__(self, task: Task, terms: Terms) -> None:
        self.task, self.terms = task, terms
        self.used = 0
        self._secured: Candidate | None = None

    @property
    def confirms(self) -> bool:
        """See `Trials`."""
        return self.terms.recorder.run.confirm

    def prove(self) -> None:
        """See `Trials`: the reference passes the suite, one that stands still fails."""
        recorder, judge = self.terms.recorder, self.terms.judge
        if recorder.past.proven and self.terms.trusts_record:
            return

        def tell(doing: str) -> None:
            recorder.tell({"event": "prove.step", "doing": doing})

        recorder.event("prove.start")
        tier, seed = self.terms.tier, recorder.run.seed
        proof = prove_suite(
            self.task, tier=tier, seed=seed, judge=judge, on_progress=tell
        )
        facts = proof.model_dump(include={"suite", "suite_sha256", "sandbox", "proven"})
        recorder.event("prove.end", **facts)

    def test(self, candidates: Sequence[Candidate]) -> None:
        """See `Trials`: at a time as many as there are cores."""
        for each in candidates:
            self.terms.recorder.event("verify.start", k=each.k, j=each.j)
        if len(candidates) < 2:
            for each in candidates:
                each.report = self._verified(each, self.terms.judge)
            return
        cores = min(len(candidates), len(os.sched_getaffinity(0)))
        with ExitStack() as stack:
            others = [
                stack.enter_context(WarmJudge(task=self.task)) for _ in range(cores - 1)
            ]
            judges: SimpleQueue[WarmJudge] = SimpleQueue()
            for judge in (self.terms.judge, *others):
                judges.put(judge)

            def tested(candidate: Candidate) -> Report:
                judge = judges.get()
                try:
                    return self._verified(candidate, judge)
                finally:
                    judges.put(judge)

            with ThreadPoolExecutor(cores) as pool:
                reports = list(pool.map(tested, candidates))
        for each, report in zip(candidates, reports, strict=True):
            each.report = report

    def _verified(self, candidate: Candidate, judge: WarmJudge) -> Report:
        """The report on a candidate; a recorded one is reused."""
        recorder, folder = self.terms.recorder, candidate.folder
        seed, file = recorder.run.seed, folder / "report.json"
        if recorder.vouches(file):
            kept = kept_report(folder, self.task, candidate.source, seed)
            if kept is not None:
                return kept
        report = verify(
            folder / "controller.py",
            self.task,
            tier=self.terms.tier,
            seed=seed,
            out=folder,
            judge=judge,
            physics=self.terms.options.physics,
        )
        recorder.vouch(file)
        return report

    def go_on(self, candidate: Candidate) -> None:
        """See `Trials`: what passed the suite drives blind."""
        if self.confirms and _report(candidate).passed:
            self.confirm(candidate)

    def recall(self, candidate: Candidate) -> None:
        """See `Trials`."""
        candidate.report = recorded_report(candidate)

    def result(self, candidate: Candidate) -> Result:
        """See `Trials`."""
        report, confirmation = _report(candidate), candidate.confirmation
        result = suite_result(report)
        if confirmation is None:
            return result
        return confirmed_result(result, report, confirmation)

    def can_explore(self, asked: int) -> bool:
        """See `Trials`."""
        shares = self.terms.shares
        return asked < shares.asked and self.used + shares.block <= shares.explore

    @cached_property
    def pool_feedback(self) -> PoolFeedback:
        """See `Trials`: starts of disturbed episodes lie near that of the task."""
        scene = self.task.nominal, self.task.setting.units
        first = seeds_for(self.terms.recorder.run, POOL, 0).start
        return PoolFeedback("episode", first, lambda _: scene)

    def counterexample(self, candidate: Candidate) -> str:
        """See `Trials`."""
        if not self.terms.options.envelope:
            return ""
        # It loads task sets, which a run on a task needs for nothing else.
        from tdac_agent.synthesis.counterexample import counterexample_text

        return counterexample_text(candidate, self.task, self.terms, 0)

    def admit(self, candidate: Candidate) -> Explored | None:
        """See `Trials`: only what passes all tests drives."""
        if candidate.report is None:
            self.test([candidate])
        report = _report(candidate)
        return None if report.passed else failed_tests(report)

    def drive_pool(self, candidate: Candidate, count: int) -> Explored | None:
        """See `Trials`."""
        report = self._drive(candidate, POOL, count, len(candidate.pool))
        candidate.pool += report.episodes
        return None

    def pool_result(self, candidate: Candidate) -> Explored:
        """See `Trials`."""
        report, rows = _report(candidate), candidate.pool
        figures, reached = task_figures(self.task, report, rows), successes_of(rows)
        told = drive_text(figures.time, int(sum(reached)), len(rows))
        # A candidate of the loop is on record already.
        about = {"k": candidate.k, "j": candidate.j, "said": told}
        self.terms.recorder.tell({"event": "improve.begin", **about})
        return Explored(
            figures,
            goals_text(int(sum(reached)), len(rows)),
            passed=True,
            seed=report.provenance.seed,
            episodes=len(rows),
        )

    def finalists(self, archive: Archive) -> list[Candidate]:
        """See `Trials`: the best member has been decided on."""
        return [archive.best().candidate]

    def validate(self, candidate: Candidate, count: int) -> None:
        """See `Trials`: there are no episodes for a selection."""

    def why_none(self, able: Sequence[Candidate]) -> str:
        """See `Trials`."""
        del able
        return ""

    def compare(self, candidate: Candidate) -> Sequence[EpisodeRow]:
        """Drives the episodes of the comparison."""
        count = self.terms.shares.comparison
        return self._drive(candidate, "comparison", count).episodes

    def secure(self, candidate: Candidate) -> None:
        """See `Trials`."""
        place_verified(self.task, candidate, self.terms.recorder)
        self._secured = candidate
        keep_confirmation(self.terms, candidate)
        recorder = self.terms.recorder
        if recorder.run.tau is None:
            passed = (each.k for each in recorder.run.attempts if each.passed)
            recorder.run.tau = min(passed, default=candidate.k)
        recorder.save()

    def deliver(self, chosen: Chosen) -> Candidate:
        """See `Trials`."""
        if chosen.archive is None:
            self.secure(chosen.candidate)
            return chosen.candidate
        terms, first = self.terms, self._secured or chosen.archive.base
        chosen = self._confirmed(chosen, first)
        figures = {"robustness": reached_of, "time": time_of}
        changes = compared(self.compare, first, chosen.candidate, figures)
        found = task_improvement(
            terms,
            self.task,
            chosen,
            changes,
            first=(first.k, first.j),
            used=self.used,
            first_seed=seeds_for(terms.recorder.run, POOL, 0).start,
            first_comparison=seeds_for(terms.recorder.run, "comparison", 0).start,
        )
        text = found.model_dump_json(indent=2) + "\n"
        write_atomic(terms.folder / IMPROVEMENT_FILE, text)
        facts = found.model_dump(mode="json", exclude={"members", "stopped"})
        terms.recorder.event("select.end", **facts)
        if chosen.candidate is not self._secured:
            self.secure(chosen.candidate)
        return chosen.candidate

    def _confirmed(self, chosen: Chosen, first: Candidate) -> Chosen:
        """What is delivered after a search: not what fails where the first one passes.

        The error of the confirmations of a run together stays below 5 %.
        """
        if not self.confirms or chosen.candidate is first:
            return chosen
        found = self.confirm(chosen.candidate)
        known = first.confirmation
        if is_verified(found) or known is None or not is_verified(known):
            return chosen
        stopped = f"the best variation was not confirmed: {confirmed_text(found)}"
        return replace(chosen, candidate=first, stopped=stopped)

    def confirm(self, candidate: Candidate) -> EpisodeReport:
        """See `Trials`; a candidate drives once."""
        if candidate.confirmation is None:
            run = self.terms.recorder.run
            number = len(run.confirmations) + 1
            candidate.confirmation = found = drive_blind(
                self.terms, self.task, candidate, number
            )
            run.confirmations.append(
                Confirmation(
                    k=candidate.k,
                    j=candidate.j,
                    episodes=found.count,
                    failures=found.count - found.successes,
                    passed=is_verified(found),
                )
            )
            if candidate is self._secured:
                keep_confirmation(self.terms, candidate)
        return candidate.confirmation

    def _drive(
        self, candidate: Candidate, purpose: str, count: int, done: int = 0
    ) -> EpisodeReport:
        """Drives the same episodes as others, after `done`; reuses those on record."""
        terms, out = self.terms, candidate.folder / f"{purpose}-{done + 1}"
        about = {"k": candidate.k, "j": candidate.j, "what": purpose, "episodes": count}
        terms.recorder.event("drive.start", **about)
        seeds = seeds_for(terms.recorder.run, purpose, done + count)[done:]
        found = drive_candidate(
            *(terms, candidate, self.task, seeds, out, about),
            disturbance=self.task.own_disturbance(),
        )
        self.used += count
        if purpose == POOL:
            candidate.pool_folders.append(out)
        terms.recorder.event("drive.end", **about, reached=found.successes)
        return found


def _report(candidate: Candidate) -> Report:
    assert candidate.report is not None
    return candidate.report
