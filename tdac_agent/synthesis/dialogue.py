"""Asks the two models of a run for controllers and rules."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

from tdac_agent.models.provider import (
    Kind,
    Provider,
    Reply,
    Request,
    is_concurrent,
)
from tdac_agent.problems.problem import Problem
from tdac_agent.prompting.extract import Answer, read_answer
from tdac_agent.prompting.feedback import Feedback
from tdac_agent.prompting.given_rules import GIVEN, RUN_HEADING, written
from tdac_agent.prompting.prompt import (
    FULL,
    PromptTemplate,
    informed_question,
    repair_question,
)
from tdac_agent.prompting.rule_answer import RuleAnswerError, apply, parse_operations
from tdac_agent.prompting.rules import BEGIN, RuleBook
from tdac_agent.storage.secrets import one_line
from tdac_agent.synthesis.calls import Calls
from tdac_agent.synthesis.side_by_side import side_by_side

MAX_ASKS = 3
MAX_EARLIER = 12
EXCERPT_CHARS = 160
_AGAIN = "\n## Your last answer could not be used\nThe reason: "
_SAME = "same code as the attempt before"
_PARSING = threading.Lock()
_ENDED = {"length": "it was truncated", "refusal": "it was refused"}


Notes = tuple[str, ...]


class ModelAnswer(NamedTuple):
    """Source of a controller (None if the model gave none) and notes on the answer."""

    source: str | None
    notes: Notes = ()


@dataclass(slots=True)
class Dialogue:
    """The Learner (LLM1) and the Optimizer (LLM2) of one run.

    Attributes:
        problem: What controllers are written for.
        learner: Generates controllers.
        optimizer: Edits them and writes rules.
        calls: Asks every question.
        book: Rules of this run, in force and ended.
        template: Template of the question for a new controller.
        earlier: The attempts so far, one line each.
    """

    problem: Problem
    learner: Provider
    optimizer: Provider
    calls: Calls
    book: RuleBook = field(default_factory=RuleBook)
    template: PromptTemplate = FULL
    earlier: tuple[str, ...] = ()
    _failed: int = 0
    _unchanged: bool = False

    def begin(self) -> None:
        """Records the rules that the run was given, if there are any."""
        if self.book.rules:
            notes = tuple(f"given {r.id}: {r.text}" for r in self.book.rules)
            self.calls.recorder.given_rules(written(self.book.rules, RUN_HEADING))
            self.calls.recorder.rules(GIVEN, self.book, notes)

    def new_candidates(
        self, given: str | None
    ) -> Iterator[tuple[range, list[ModelAnswer]]]:
        """Asks for the new controllers of the run, one group after the other.

        Args:
            given: Source of an initial controller, which is the first of all.

        Yields:
            The iterations of a group, and their controllers.
        """
        run = self.calls.recorder.run
        for first in range(1, run.iterations + 1, run.candidates):
            ks = range(first, min(first + run.candidates, run.iterations + 1))
            begun = [ModelAnswer(given)] if first == 1 and given is not None else []
            yield ks, [*begun, *self.generate_all(ks[len(begun) :])]

    def generate_all(self, ks: Sequence[int]) -> list[ModelAnswer]:
        """Asks for new controllers (k, 0), at the same time if the model permits it."""
        question = self._question()
        requests = [self._request("generate", question, k) for k in ks]
        asking = [partial(self._code, self.learner, request) for request in requests]
        if not is_concurrent(self.learner):
            return [ask() for ask in asking]
        return side_by_side(asking)

    def edit(self, k: int, j: int, source: str, failure: Feedback) -> ModelAnswer:
        """Asks for a repaired controller, candidate (k, j).

        Args:
            k: Its iteration.
            j: Its edit.
            source: Source of the failed controller.
            failure: How it failed.
        """
        request = self._repair("edit", source, failure, self._at(k, j))
        return self._code(self.optimizer, request)

    def improve(self, k: int, source: str, text: str, aim: str) -> ModelAnswer:
        """Asks for a better controller, candidate (k, 0).

        Args:
            k: Number of the candidate.
            source: Source of the controller.
            text: How it drives, and what was tried with it.
            aim: What to raise.
        """
        question = repair_question("improve", self._question(), source, text, aim=aim)
        request = self._request("improve", question, k, source)
        return self._code(self.optimizer, request)

    def informed(self, k: int, known: str, count: int) -> ModelAnswer:
        """Asks for a new controller (k, 0), with what earlier ones have shown.

        Args:
            k: Number of the candidate.
            known: What they have shown.
            count: Their number.
        """
        question = informed_question(self._question(), known, count)
        return self._code(self.learner, self._request("generate", question, k))

    def summarise(self, k: int, j: int, source: str, failure: Feedback) -> None:
        """Asks for changes of the rules after a failure, and applies them.

        After a malformed answer, asks up to twice more; then the rules stay unchanged.
        """
        request = self._repair("summarise", source, failure, self._at(k, j))
        for asked in range(1, MAX_ASKS + 1):
            reply = self.calls.ask(self.optimizer, request)
            try:
                if reply.stop != "end":
                    raise RuleAnswerError(_ENDED[reply.stop])
                operations = parse_operations(reply.text)
            except RuleAnswerError as error:
                request = self._again(request, reply, str(error), asked)
                continue
            self.book, notes = apply(self.book, operations, k, failure.failed)
            self.calls.recorder.rules(k, self.book, notes or ("no change",))
            return
        self.calls.recorder.rules(k, self.book, ("no usable answer: rules unchanged",))

    def saw_no_change(self, k: int, j: int) -> None:
        """Notes that candidate (k, j) has the same code as the previous attempt."""
        self.earlier = (*self.earlier, f"k={k} j={j}: no change: {_SAME}")
        self._unchanged = True

    def saw_again(self, k: int, j: int, first: tuple[int, int]) -> None:
        """Notes that candidate (k, j) has the code of an earlier candidate."""
        self.earlier = (*self.earlier, f"k={k} j={j}: {same_as(*first)}")
        self._unchanged = False

    def saw(self, k: int, j: int, result: Feedback) -> None:
        """Notes the result of candidate (k, j), and updates the rules in force."""
        self._unchanged = False
        failed = result.failed
        if j == 0 and self.book.in_force:
            self.book = self.book.observed(failed, self._failed)
            self.calls.recorder.rules(k, self.book)
        self._failed = len(failed)
        if failed:
            self.earlier = (*self.earlier, f"k={k} j={j}: {result.line}")

    def _question(self) -> str:
        return self.problem.question(self.book.in_force, self.template)

    def _request(
        self, kind: Kind, question: str, k: int, source: str | None = None
    ) -> Request:
        """A question for candidate (k, 0), which may build on a controller."""
        return Request(
            kind,
            question,
            source,
            rules=self._texts(),
            sample=self._at(k, 0),
            stable=_stable(question),
            max_tokens=self.calls.max_output,
        )

    def _repair(
        self,
        kind: Kind,
        source: str,
        failure: Feedback,
        sample: tuple[int, int, int],
    ) -> Request:
        question = repair_question(
            kind,
            self._question(),
            source,
            failure.text,
            # Without the last attempt, which the question is about.
            earlier=self.earlier[:-1][-MAX_EARLIER:],
            rules=self.book.in_force,
            unchanged=self._unchanged,
            scope=self.problem.scope,
        )
        stable = _stable(question)
        return Request(
            kind,
            question,
            source,
            failure.report,
            self._texts(),
            sample,
            stable=stable,
            max_tokens=self.calls.max_output,
        )

    def _code(self, model: Provider, request: Request) -> ModelAnswer:
        """Asks for code; up to twice more after an unusable answer.

        The repeated question says what was wrong. A truncated answer is never used; it
        is requested again with a higher token limit.
        """
        problems = []
        for asked in range(1, MAX_ASKS + 1):
            reply = self.calls.ask(model, request)
            # Two threads that parse at once make Python 3.11 fail with SystemError.
            with _PARSING:
                answer = self._file_in(reply)
            if answer.source is not None:
                return ModelAnswer(answer.source, reply.notes)
            problems.append(answer.problem)
            request = self._again(request, reply, answer.problem, asked)
        reasons = "; ".join(dict.fromkeys(problems))
        why = f"none of {MAX_ASKS} answers could be used: {reasons}"
        return ModelAnswer(None, (*reply.notes, why))

    def _file_in(self, reply: Reply) -> Answer:
        """The file in a reply; a truncated or refused reply has none."""
        if reply.stop != "end":
            return Answer(None, _ENDED[reply.stop])
        # A server that names its model also reports why an answer ended.
        ended = reply.model is not None
        return read_answer(reply.text, self.problem.contract, ended=ended)

    def _again(
        self, request: Request, reply: Reply, problem: str, asked: int
    ) -> Request:
        """The same question, with what was wrong with the last answer."""
        # The answer may be long, and begin with white space.
        says = one_line(reply.text[:2000], EXCERPT_CHARS)
        facts = {"problem": problem, "says": says, "asked": asked, "most": MAX_ASKS}
        self.calls.unused(request, **facts)
        first = request.prompt.partition(_AGAIN)[0]
        prompt = f"{first}{_AGAIN}{problem}. Give the whole answer again.\n"
        limit = request.max_tokens
        if reply.stop == "length":
            limit = 2 * self.calls.max_output
        return replace(request, prompt=prompt, max_tokens=limit)

    def _texts(self) -> tuple[str, ...]:
        return tuple(rule.text for rule in self.book.in_force)

    def _at(self, k: int, j: int) -> tuple[int, int, int]:
        return (self.calls.recorder.run.index, k, j)


def _stable(prompt: str) -> int:
    """Length of the part before the rules, which is the same in the whole run."""
    return max(0, prompt.find(BEGIN))


def same_as(k: int, j: int) -> str:
    """What is noted on an answer with the code of candidate (k, j)."""
    return f"same code as k={k} j={j}"
