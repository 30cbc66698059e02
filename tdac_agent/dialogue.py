"""Asking the two models: questions out, sources and rules back, all on record."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

from tdac_agent.calls import ask
from tdac_agent.extract import extract_source
from tdac_agent.prompt import generate_prompt, repair_prompt
from tdac_agent.provider import MAX_OUTPUT_TOKENS, Kind, Provider, Reply, Request
from tdac_agent.records import Recorder
from tdac_agent.report import Report
from tdac_agent.retry import RetryPolicy
from tdac_agent.rules import BEGIN, RepairRule, add_rules, parse_rules
from tdac_agent.task import Task

MAX_ASKS = 3


class Candidate(NamedTuple):
    """A controller's source, None where the model gave no code, and what it noted."""

    source: str | None
    notes: tuple[str, ...] = ()


@dataclass(slots=True)
class Dialogue:
    """The Learner (LLM1) and the Optimizer (LLM2) of one run.

    Attributes:
        task: What the controller must do.
        learner: Generates controllers.
        optimizer: Edits them and writes rules.
        recorder: Keeps every question and answer.
        rules: Rules in force.
        retry: How patiently a model is asked.
    """

    task: Task
    learner: Provider
    optimizer: Provider
    recorder: Recorder
    rules: tuple[RepairRule, ...] = ()
    retry: RetryPolicy = field(default_factory=RetryPolicy)

    def generate(self, k: int) -> Candidate:
        """A new controller under the rules in force."""
        prompt = generate_prompt(self.task, self.rules)
        request = Request(
            "generate",
            prompt,
            rules=self._texts(),
            sample=self._at(k, 0),
            stable=_stable(prompt),
        )
        return self._code(self.learner, request)

    def edit(self, k: int, j: int, source: str, report: Report) -> Candidate:
        """A repaired controller, candidate (k, j)."""
        request = self._repair("edit", source, report, self._at(k, j))
        return self._code(self.optimizer, request)

    def summarise(self, k: int, j: int, source: str, report: Report) -> None:
        """Adds what is to be learnt from a failure to the rules."""
        request = self._repair("summarise", source, report, self._at(k, j))
        reply = self._ask(self.optimizer, request)
        evidence = tuple(failure.test for failure in report.failures)
        self.rules = add_rules(self.rules, parse_rules(reply.text), k, evidence)
        self.recorder.rules(k, self.rules)

    def _repair(
        self, kind: Kind, source: str, report: Report, sample: tuple[int, int, int]
    ) -> Request:
        prompt = generate_prompt(self.task, self.rules)
        question = repair_prompt(kind, prompt, source, report)
        stable = _stable(question)
        return Request(
            kind, question, source, report, self._texts(), sample, stable=stable
        )

    def _code(self, model: Provider, request: Request) -> Candidate:
        """Asks until a whole answer holds code; a refused one is asked again twice.

        A truncated one is never used, and asked for again with more room.
        """
        notes: tuple[str, ...] = ()
        for _ in range(MAX_ASKS):
            reply = self._ask(model, request)
            notes = reply.notes
            source = extract_source(reply.text) if reply.stop == "end" else None
            if source is not None:
                return Candidate(source, notes)
            if reply.stop == "length":
                request = replace(request, max_tokens=2 * MAX_OUTPUT_TOKENS)
        return Candidate(None, notes)

    def _ask(self, model: Provider, request: Request) -> Reply:
        return ask(model, request, self.recorder, self.retry)

    def _texts(self) -> tuple[str, ...]:
        return tuple(rule.text for rule in self.rules)

    def _at(self, k: int, j: int) -> tuple[int, int, int]:
        return (self.recorder.run.seed, k, j)


def _stable(prompt: str) -> int:
    """How much of a prompt is the same in all of a run: all before its rules."""
    return max(0, prompt.find(BEGIN))
