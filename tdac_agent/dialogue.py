"""Asking the two models: questions out, sources and rules back, all on record."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from tdac_agent.errors import Fault
from tdac_agent.extract import extract_source
from tdac_agent.prompt import generate_prompt, repair_prompt
from tdac_agent.provider import Kind, Provider, ProviderFault, Reply, Request
from tdac_agent.records import Recorder
from tdac_agent.report import Report
from tdac_agent.rules import RepairRule, add_rules, parse_rules
from tdac_agent.task import Task

MAX_RETRIES = 3
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
    """

    task: Task
    learner: Provider
    optimizer: Provider
    recorder: Recorder
    rules: tuple[RepairRule, ...] = ()

    def generate(self, k: int) -> Candidate:
        """A new controller under the rules in force."""
        prompt = generate_prompt(self.task, self.rules)
        request = Request(
            "generate", prompt, rules=self._texts(), sample=self._at(k, 0)
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
        return Request(kind, question, source, report, self._texts(), sample)

    def _code(self, model: Provider, request: Request) -> Candidate:
        """Asks until a whole answer holds code; a refused one is asked again twice."""
        notes: tuple[str, ...] = ()
        for _ in range(MAX_ASKS):
            reply = self._ask(model, request)
            notes = reply.notes
            source = extract_source(reply.text) if reply.stop == "end" else None
            if source is not None:
                return Candidate(source, notes)
        return Candidate(None, notes)

    def _ask(self, model: Provider, request: Request) -> Reply:
        """Asks; an infrastructure fault uses up no iteration, three stop the run."""
        self.recorder.asked(request)
        for attempt in range(1, MAX_RETRIES + 1):
            try:
                reply = model.complete(request)
            except ProviderFault as error:
                self.recorder.event("call.fault", attempt=attempt, reason=str(error))
                reason = str(error)
            else:
                self.recorder.answered(request, reply)
                return reply
        raise Fault(f"{model.name} failed {MAX_RETRIES} times: {reason}")

    def _texts(self) -> tuple[str, ...]:
        return tuple(rule.text for rule in self.rules)

    def _at(self, k: int, j: int) -> tuple[int, int, int]:
        return (self.recorder.run.seed, k, j)
