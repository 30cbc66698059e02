"""Trials on a task set: candidates drive on worlds of `dev`, within a budget."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

from tdac_agent.runs.run_record import Status
from tdac_agent.runs.selection_record import SELECTION_FILE
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.hashes import number_of
from tdac_agent.synthesis.archive import Archive
from tdac_agent.synthesis.candidates import (
    Candidate,
    Explored,
    Result,
    ToldEpisode,
)
from tdac_agent.synthesis.counterexample import counterexample_text
from tdac_agent.synthesis.delivery import Compared, compared, selection_of
from tdac_agent.synthesis.disturbed import time_of
from tdac_agent.synthesis.driving import drive_candidate
from tdac_agent.synthesis.hidden import hidden_report
from tdac_agent.synthesis.pool_feedback import PoolFeedback
from tdac_agent.synthesis.set_reports import (
    figures_of,
    set_feedback,
    summary_of,
)
from tdac_agent.synthesis.terms import Chosen, Terms
from tdac_agent.synthesis.tested import (
    REPORT_FILE,
    failed_tests,
    recorded_report,
    suite_result,
)
from tdac_agent.synthesis.workload import MOST_EPISODES
from tdac_agent.tasks.setting import Nominal
from tdac_agent.tasks.units import Units
from tdac_agent.verification.diagnosis.report import Report
from tdac_agent.verification.episode_report import EpisodeReport, cause_of
from tdac_agent.verification.judge.episode_row import EpisodeRow
from tdac_agent.verification.judge.set_worlds import shown_units
from tdac_agent.verification.own_tests import kept_tests, run_own_tests
from tdac_agent.verification.store import read_report
from tdac_envs.ladder.task_sets import TaskSet

BLOCKS = 2**30
"""Feedback worlds have smaller numbers than this; each other purpose has as many."""
PURPOSES = ("feedback", "validation", "improve", "comparison")
"""What worlds are used for, in the order of their numbers."""
STANDS_STILL = b"def policy(obs):\n    return 0.0, 0.0\n"
FINALISTS = 4
"""Most candidates that go on to the selection, beside the best one of the loop."""
FEEDBACK = "feedback-{}"
"""Folders of the tests of a candidate, inside its own."""


def first_world(seed: int, index: int) -> int:
    """Number of the first feedback world of a run, below `BLOCKS` - `MOST_EPISODES`."""
    return number_of(f"dev block|{seed}|{index}") % (BLOCKS - MOST_EPISODES)


class WorldTrials:
    """See `Trials`. No world is used twice, nor for two purposes.

    Args:
        tasks: The task set.
        terms: What all tests share.
        suite: Folder of the user's own tests, which come before the first world.

    Attributes:
        used: Number of episodes that were driven, by purpose.
    """

    status: Status = "selected"
    ended = "all feedback episodes were driven"
    needs_new_code = True
    aim = "What counts is the mean time score on worlds that nobody has seen yet."

    def __init__(self, tasks: TaskSet, terms: Terms, suite: Path | None = None) -> None:
        self.tasks, self.terms, self.suite = tasks, terms, suite
        self.used = dict.fromkeys(PURPOSES, 0)

    @property
    def confirms(self) -> bool:
        """See `Trials`."""
        return self.terms.recorder.run.then_verify

    @property
    def tests_left(self) -> int:
        """See `Trials`."""
        return self.terms.shares.feedback - self.used["feedback"]

    def prove(self) -> None:
        """See `Trials`: the user's own tests give a verdict, whichever it is."""
        recorder = self.terms.recorder
        if self.suite is None or (recorder.past.proven and self.terms.trusts_record):
            return
        recorder.event("prove.start")
        report = self._own_tests(STANDS_STILL, self.suite)
        about = report.provenance
        facts = {"suite": about.suite, "suite_sha256": about.suite_sha256}
        recorder.event("prove.end", **facts, sandbox=about.sandbox, proven=True)

    def test(self, candidates: Sequence[Candidate]) -> None:
        """See `Trials`: all of them drive on the same next worlds.

        One that fails the user's own tests drives on none. If the episodes do not
        suffice for all, the first ones drive on one world.
        """
        if not candidates:
            return
        count = min(self.terms.block, max(1, self.tests_left // len(candidates)))
        first = self.first_for("feedback") + self.used["feedback"]
        for candidate in candidates:
            if self.tests_left >= count and self._passes(candidate):
                out = FEEDBACK.format(len(candidate.feedback) + 1)
                report = self._drive(candidate, "feedback", first, count, out)
                candidate.feedback.append(report)

    def go_on(self, candidate: Candidate) -> None:
        """See `Trials`: it drives on the next worlds."""
        while self.tests_left and candidate.first_failure is None:
            self.test([candidate])
            if candidate.refused:
                break

    def recall(self, candidate: Candidate) -> None:
        """See `Trials`."""
        if self.suite is not None:
            candidate.report = recorded_report(candidate)
            if candidate.refused:
                return
        folder = candidate.folder / FEEDBACK.format(1)
        report = read_report(folder)
        if report is None:
            raise ValueError(f"no report in {folder}")
        candidate.feedback.append(report)
        self.used["feedback"] += report.count

    def result(self, candidate: Candidate) -> Result:
        """See `Trials`."""
        if candidate.report is not None and candidate.refused:
            return suite_result(candidate.report)
        reports, failed = candidate.feedback, candidate.first_failure
        worlds = sum(each.count for each in reports)
        reached = sum(each.successes for each in reports)
        said = f"the goal reached in {reached} of {worlds} worlds"
        if not reports:
            said = "not tested: no feedback episodes are left"
        failure = None
        if failed is not None:
            failure, said = set_feedback(failed), summary_of(failed)
            if worlds > failed.count:
                before = worlds - failed.count
                said = f"{before} worlds without a failure, then {said}"
        score = candidate.feedback_score
        return Result(
            failed is None and worlds > 0,
            (score, candidate.drives),
            failure,
            f"{said}; mean score {score:.3f}" if worlds else said,
            said,
            unfit="" if worlds else "the static and contract tests refused it",
            failed=() if failure is None else failure.failed,
            episodes=tuple(
                ToldEpisode(
                    str(each.index), each.outcome, each.steps, each.smallest_gap
                )
                for report in reports
                for each in report.episodes
            ),
        )

    def can_explore(self, asked: int) -> bool:
        """See `Trials`."""
        del asked
        shares = self.terms.shares
        return self.used["improve"] + shares.block <= shares.explore

    @cached_property
    def pool_feedback(self) -> PoolFeedback:
        """See `Trials`."""
        return PoolFeedback("world", self.first_for("improve"), self._scene)

    def counterexample(self, candidate: Candidate) -> str:
        """See `Trials`."""
        first = self.first_for("improve")
        return counterexample_text(candidate, self.tasks, self.terms, first)

    def _scene(self, number: int) -> tuple[Nominal, Units]:
        task = self.tasks.task("dev", number)
        return task, shown_units(self.tasks.file, task)

    def admit(self, candidate: Candidate) -> Explored | None:
        """See `Trials`: the user's own tests."""
        if self._passes(candidate):
            return None
        assert candidate.report is not None
        return failed_tests(candidate.report)

    def drive_pool(self, candidate: Candidate, count: int) -> Explored | None:
        """See `Trials`."""
        report = self._driven(candidate, "improve", count, len(candidate.pool))
        if not report.count:
            found, failed = set_feedback(report), tuple(report.told)
            return Explored(
                None, found.line, failed=failed, drove=False, feedback=found.text
            )
        candidate.pool += report.episodes
        return None

    def pool_result(self, candidate: Candidate) -> Explored:
        """See `Trials`."""
        rows = candidate.pool
        reached = sum(each.success for each in rows)
        causes = {cause_of(each) for each in rows if not each.success}
        return Explored(
            figures_of(rows),
            f"the goal reached in {reached} of {len(rows)} worlds",
            passed=reached == len(rows),
            failed=tuple(sorted(causes)),
            episodes=len(rows),
        )

    def finalists(self, archive: Archive) -> list[Candidate]:
        """See `Trials`: one, if there are no episodes for a selection."""
        if not self.terms.shares.validation:
            return [archive.best().candidate]
        return archive.finalists(FINALISTS)

    def validate(self, candidate: Candidate, count: int) -> None:
        """See `Trials`."""
        done = len(candidate.validation)
        report = self._driven(candidate, "validation", count, done)
        candidate.validation.extend(report.episodes)

    def why_none(self, able: Sequence[Candidate]) -> str:
        """See `Trials`."""
        if not able:
            return "no candidate passed the static and contract tests"
        return "no candidate reached a goal on the validation worlds"

    def compare(self, candidate: Candidate) -> Sequence[EpisodeRow]:
        """Drives the worlds of the comparison."""
        count = self.terms.shares.comparison
        return self._driven(candidate, "comparison", count).episodes

    def secure(self, candidate: Candidate) -> None:
        """See `Trials`: nothing is verified before the selection."""

    def deliver(self, chosen: Chosen) -> Candidate:
        """See `Trials`."""
        terms, changes = self.terms, Compared({}, {}, {})
        if chosen.archive is not None and terms.shares.comparison:
            base = chosen.archive.base
            changes = compared(self.compare, base, chosen.candidate, {"time": time_of})
        selection = selection_of(
            terms,
            self.tasks,
            chosen,
            changes,
            self.used,
            first_feedback=self.first_for("feedback"),
            first_validation=self.first_for("validation"),
        )
        text = selection.model_dump_json(indent=2) + "\n"
        terms.recorder.deliver(chosen.candidate.source)
        write_atomic(terms.folder / SELECTION_FILE, text)
        values = selection.model_dump(mode="json", exclude={"candidates", "stopped"})
        terms.recorder.event("select.end", **values)
        return chosen.candidate

    def confirm(self, candidate: Candidate) -> EpisodeReport:
        """See `Trials`."""
        return hidden_report(self.tasks, candidate, self.terms)

    def _passes(self, candidate: Candidate) -> bool:
        """Whether it passes the user's own tests, if there are any; tested once."""
        if self.suite is not None and candidate.report is None:
            self.terms.recorder.event("verify.start", k=candidate.k, j=candidate.j)
            candidate.report = self._tested(candidate, self.suite)
        return not candidate.refused

    def _tested(self, candidate: Candidate, suite: Path) -> Report:
        """The report of the user's own tests; a recorded one is reused."""
        recorder, folder = self.terms.recorder, candidate.folder
        if recorder.vouches(folder / REPORT_FILE):
            seed, raw = recorder.run.seed, candidate.raw
            kept = kept_tests(folder, self.tasks, suite, raw, seed)
            if kept is not None:
                return kept
        report = self._own_tests(candidate.raw, suite, folder)
        recorder.vouch(folder / REPORT_FILE)
        return report

    def _own_tests(self, source: bytes, suite: Path, out: Path | None = None) -> Report:
        terms = self.terms
        return run_own_tests(
            source,
            self.tasks,
            suite,
            tier=terms.tier,
            seed=terms.recorder.run.seed,
            out=out,
            judge=terms.judge,
        )

    def first_for(self, purpose: str) -> int:
        """Number of the first world for a purpose."""
        run = self.terms.recorder.run
        assert run.seed is not None
        return PURPOSES.index(purpose) * BLOCKS + first_world(run.seed, run.index)

    def _driven(
        self, candidate: Candidate, purpose: str, count: int, done: int = 0
    ) -> EpisodeReport:
        """Drives on the worlds for a purpose, the same for all, after `done` ones."""
        first = self.first_for(purpose) + done
        return self._drive(candidate, purpose, first, count, f"{purpose}-{done + 1}")

    def _drive(
        self, candidate: Candidate, purpose: str, first: int, count: int, out: str
    ) -> EpisodeReport:
        """Drives on worlds of `dev`; a report on record is reused."""
        terms, folder = self.terms, candidate.folder / out
        about = {"k": candidate.k, "j": candidate.j, "what": purpose, "worlds": count}
        terms.recorder.event("drive.start", **about)
        numbers = range(first, first + count)
        report = drive_candidate(
            *(terms, candidate, self.tasks, numbers, folder, about), split="dev"
        )
        self.used[purpose] += report.count
        if purpose == "improve":
            candidate.pool_folders.append(folder)
        ended = {"reached": report.successes, "driven": report.count}
        terms.recorder.event("drive.end", **about, **ended)
        return report
