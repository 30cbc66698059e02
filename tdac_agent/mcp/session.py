"""The session of the server on one run: what each tool does, one after another."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tdac_agent.errors import Fault, RunError
from tdac_agent.mcp.answers import (
    ChooseAnswer,
    EpisodeAnswer,
    Left,
    Refused,
    SubmissionLine,
    SubmissionsAnswer,
    SubmitAnswer,
    blind_verdict,
    hidden_verdict,
)
from tdac_agent.mcp.instructions import instructions
from tdac_agent.mcp.pictures import draw
from tdac_agent.mcp.submitted import source_of
from tdac_agent.mcp.watch import Watch
from tdac_agent.problems.problem import Problem
from tdac_agent.runs.falsify_text import NO_PROOF, failure_text, summary_of
from tdac_agent.runs.recorder import Recorder
from tdac_agent.runs.run_record import JOURNAL, Run, candidate_at
from tdac_agent.runs.selection_record import HIDDEN_FILE
from tdac_agent.storage.journal import read_records
from tdac_agent.storage.plain import one_line
from tdac_agent.synthesis.candidates import Candidate
from tdac_agent.synthesis.hidden import read_hidden_report
from tdac_agent.synthesis.terms import Chosen
from tdac_agent.synthesis.trials import Trials, conclude
from tdac_agent.verification.confirmation import CONFIRMATION_FILE, read_confirmation
from tdac_envs.core.errors import TdacError, one_line_reason
from tdac_envs.core.intake import TEXT_BYTES, read_file

MOST_CLIENTS = 20
LONGEST_NAME = 100
SUBMIT, CHOOSE, CLIENT = "submit", "choose", "client"
"""Records of the journal."""


@dataclass(slots=True)
class Session:
    """A run whose candidates are submitted by agents.

    All methods but `watch.stop` are called from one thread, one after another.

    Attributes:
        problem: What the submissions are for.
        trials: Tests them.
        watch: Follows the work.
        submissions: The submissions so far; number n is the candidate (n, 0).
        chosen: Number of the submission that was chosen, if one was.
        ready: Whether the record of earlier processes has been read.
    """

    problem: Problem
    trials: Trials
    watch: Watch
    submissions: list[Candidate] = field(default_factory=list)
    chosen: int | None = None
    ready: bool = False

    @property
    def recorder(self) -> Recorder:
        """Records the run."""
        return self.trials.terms.recorder

    @property
    def run(self) -> Run:
        """The record of the run."""
        return self.recorder.run

    @property
    def left(self) -> Left:
        """What is left of the budget."""
        fixed = self.run.finished or self.chosen is not None
        left = max(0, self.run.iterations - len(self.submissions))
        return Left(0 if fixed else left, self.trials.tests_left)

    def catch_up(self) -> None:
        """Reads what earlier processes did, and judges what they had not finished.

        Raises:
            Fault: The sandbox is broken.
        """
        if self.ready:
            return
        ended = self.run.finished
        while (source := self._source(len(self.submissions) + 1)) is not None:
            self._judge(source, recall=ended)
        choices = [each for each in read_records(self._journal) if _is_choice(each)]
        if choices and 1 <= choices[-1]["k"] <= len(self.submissions):
            self.chosen = choices[-1]["k"]
        self.ready = True
        if not ended and self.chosen is not None:
            self._conclude(self.submissions[self.chosen - 1])
        self._end_if_hopeless()

    def met(self, client: str) -> None:
        """Records the program of an agent, once."""
        name = _named(client)
        known = self.run.clients
        if name in known or len(known) == MOST_CLIENTS or self.run.finished:
            return
        self.run.clients = (*known, name)
        self.recorder.event(CLIENT, client=name, agent=self.run.agent)
        self.recorder.save()

    def read_task(self) -> str:
        """What is to be written, and how this server works."""
        problem = self.problem
        return instructions(problem.called, self.left, problem.question())

    def submit(self, text: str, client: str) -> SubmitAnswer:
        """Judges a controller.

        Args:
            text: Its source; fences around it are removed.
            client: Who submits it.

        Raises:
            Refused: The budget is spent, the run has ended, or the file is too large.
            Fault: The sandbox is broken; the submission does not count.
        """
        source = source_of(text)
        self._check_open()
        if self.left.episodes is None:
            for each in self.submissions:
                if each.source == source:  # the verdict would be the same
                    return self._answer(each)
        if self.left.spent:
            raise Refused(
                f"the budget is spent after {len(self.submissions)} submissions: call "
                "choose with the best one"
            )
        number = len(self.submissions) + 1
        try:
            submission = self._judge(source, client)
        except (Fault, TdacError) as error:
            # The next start must not judge what the agent will submit again.
            (self._folder(number) / "controller.py").unlink(missing_ok=True)
            raise Fault(f"{error}; this submission does not count") from error
        answer = self._answer(submission)
        self._end_if_hopeless()
        return answer

    def failures(self, number: int, envelope: int = 0) -> str:
        """What failed in a submission.

        Args:
            number: Its number.
            envelope: Most episodes of a search for the smallest deviation with which
                it fails; 0 for none.

        Raises:
            Refused: There is no such submission, or no such search for it.
        """
        submission = self._submission(number)
        result = self.trials.result(submission)
        if envelope and (self.problem.task is None or not result.passed):
            raise Refused("envelope: it needs a task, and a submission that passed")
        if not result.passed and result.failure is not None:
            return result.failure.text
        told = f"nothing failed: {result.summary}; only choose({number}) can verify it"
        return f"{told}\n{self._envelope(submission, envelope)}" if envelope else told

    def _envelope(self, submission: Candidate, episodes: int) -> str:
        """The smallest failure that a search finds, in words."""
        # Only for agents that ask for it: slow to import.
        from tdac_agent.falsify.falsify import LEAST, SearchPlan
        from tdac_agent.synthesis.counterexample import searched

        if episodes < LEAST:
            raise Refused(f"envelope: expected 0, or {LEAST} and more, got {episodes}")
        assert self.problem.task is not None
        plan, terms = SearchPlan(episodes=episodes), self.trials.terms
        found = searched(submission, self.problem.task, plan, terms)
        text, failed = summary_of(found), found.counterexample
        if failed is not None:
            text += f"\n{failure_text(failed, found)}"
        return f"{text}\n{NO_PROOF.format(found.episodes)}"

    def picture(self, number: int, episode: str) -> bytes:
        """A PNG of an episode of a submission."""
        return draw(self.problem, self._submission(number), episode)

    def listed(self) -> SubmissionsAnswer:
        """All submissions, and what is left of the budget."""
        left = self.left
        return SubmissionsAnswer(
            submissions=[
                SubmissionLine(
                    submission=each.k,
                    passed=self._passed(each),
                    verified=self.run.verified and each.k == self.chosen,
                    can_be_chosen=not self._unfit(each) and not self.run.finished,
                    summary=self.trials.result(each).summary,
                )
                for each in self.submissions
            ],
            submissions_left=left.submissions,
            episodes_left=left.episodes,
            chosen=self.chosen,
            ended=self._ending() if self.run.finished else None,
        )

    def _passed(self, submission: Candidate) -> bool:
        """Whether it passed the suite of a task."""
        result = self.trials.result(submission)
        return not self.problem.has_hidden and not result.unfit

    def _unfit(self, submission: Candidate) -> str:
        """Why it cannot be chosen; empty if it can."""
        unfit = self.trials.result(submission).unfit
        if not unfit or self.problem.has_hidden:
            return unfit
        return f"{unfit}; only a submission that passed can be chosen"

    def choose(self, number: int) -> ChooseAnswer:
        """Fixes the controller, gives the verdict, and ends the run.

        The same choice again is answered with the same verdict.

        Raises:
            Refused: It cannot be chosen, or another one was.
            Fault: The sandbox is broken; the choice remains.
        """
        submission = self._submission(number)
        if self.chosen not in (None, number):
            raise Refused(f"submission {self.chosen} was chosen; that is final")
        if not self.run.finished:
            unfit = self._unfit(submission)
            if unfit:
                raise Refused(f"submission {number} cannot be chosen: {unfit}")
            if self.chosen is None:
                self.recorder.event(CHOOSE, k=number)
                self.chosen = number
            self._conclude(submission)
        elif self.chosen is None:
            raise Refused(self._ending())
        if self.problem.has_hidden:
            self._check_written(HIDDEN_FILE)
            return hidden_verdict(number, read_hidden_report(self.run.folder))
        found = read_confirmation(self.run)
        if found is None:
            self._check_written(CONFIRMATION_FILE)
            raise Refused(f"{self._ending()}; {CONFIRMATION_FILE} is about another one")
        return blind_verdict(number, found)

    def _check_written(self, name: str) -> None:
        """Refuses a verdict in a file that this run did not write as it is now."""
        if not self.recorder.vouches(self.run.folder / name):
            raise Refused(f"{self._ending()}; {name} is missing or was changed")

    def close(self) -> None:
        """Records that the run was interrupted, unless it has ended."""
        if self.ready and not self.run.finished:
            self.recorder.finish("interrupted")

    @property
    def _journal(self) -> Path:
        return self.run.folder / JOURNAL

    def _folder(self, number: int) -> Path:
        return self.run.folder / candidate_at(number, 0)

    def _source(self, number: int) -> str | None:
        """The source of a submission on disk; None if there is none."""
        path = self._folder(number) / "controller.py"
        if not path.is_file():
            return None
        return read_file(path, TEXT_BYTES).decode("utf-8", "surrogatepass")

    def _judge(
        self, source: str, client: str | None = None, *, recall: bool = False
    ) -> Candidate:
        """Judges a file, which is written before.

        Args:
            source: The file.
            client: Who submits it, if it is new.
            recall: Whether its result is on record, as in a run that has ended.

        Raises:
            Fault: The sandbox is broken; the controller neither passes nor fails.
            RunError: Its recorded result cannot be read.
        """
        number = len(self.submissions) + 1
        submission = Candidate(number, 0, source, self._folder(number))
        if recall:
            try:
                self.trials.recall(submission)
            except (OSError, ValueError) as error:
                why = f"submission {number} cannot be read: {one_line_reason(error)}"
                raise RunError(why) from error
        else:
            self.recorder.candidate(number, 0, source)
            if client is not None:
                facts = {"sha256": submission.sha256, "client": _named(client)}
                self.recorder.event(SUBMIT, k=number, **facts)
            self.trials.test([submission])
            result = self.trials.result(submission)
            notes = (result.said,) if result.said else ()
            self.recorder.attempted(result.attempt(number, 0, notes))
        self.submissions.append(submission)
        return submission

    def _conclude(self, submission: Candidate) -> None:
        """Delivers a controller and ends the run; repeated after an interruption.

        Raises:
            Fault: The sandbox is broken; the run goes on, with this choice.
        """
        conclude(self.trials, Chosen(submission, self.submissions))

    def _submission(self, number: int) -> Candidate:
        if 1 <= number <= len(self.submissions):
            return self.submissions[number - 1]
        known = len(self.submissions)
        many = f"expected 1 to {known}" if known > 1 else "there is only submission 1"
        raise Refused(
            f"there is no submission {number}; "
            + (many if known else "nothing has been submitted")
        )

    def _check_open(self) -> None:
        """Refuses submissions after the choice.

        Raises:
            Refused: The run has ended, or will end with this choice.
        """
        if self.run.finished:
            raise Refused(f"{self._ending()}; nothing can be submitted any more")
        if self.chosen is not None:
            raise Refused(
                f"submission {self.chosen} was chosen, so nothing can be submitted; "
                f"choose({self.chosen}) gives the verdict"
            )

    def _answer(self, submission: Candidate) -> SubmitAnswer:
        result, left = self.trials.result(submission), self.left
        return SubmitAnswer(
            submission=submission.k,
            passed=self._passed(submission),
            summary=result.summary,
            episodes=[
                EpisodeAnswer(
                    name=each.name,
                    outcome=each.outcome,
                    steps=each.steps,
                    gap=None if (gap := each.smallest_gap) is None else gap.gap,
                    too_close=gap is not None and gap.too_close,
                )
                for each in result.episodes
            ],
            submissions_left=left.submissions,
            episodes_left=left.episodes,
        )

    def _end_if_hopeless(self) -> None:
        """Ends a run in which nothing can be submitted or chosen any more."""
        if self.run.finished or not self.left.spent:
            return
        if all(map(self._unfit, self.submissions)):
            self.recorder.finish("not verified", reason="all submissions failed")

    def _ending(self) -> str:
        """How the run ended, in one line."""
        if self.chosen is None:
            return f"the run has ended, {self.run.status}: {self.run.reason}"
        return (
            f"the run has ended: submission {self.chosen} was chosen and is "
            f"{self.run.status}"
        )


def _named(client: str) -> str:
    """The name of an agent's program, for records."""
    return one_line(client)[:LONGEST_NAME]


def _is_choice(record: dict[str, Any]) -> bool:
    return record.get("event") == CHOOSE and isinstance(record.get("k"), int)
