"""Asks the models: every question of a run passes through this module.

A question on record is answered from there. For any other question, the maximum cost is
reserved, the question is recorded and asked, and the actual cost is settled.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from tdac_agent.errors import Fault
from tdac_agent.models.bounds import check_reply
from tdac_agent.models.budget import NOTHING, Amount, Budget, BudgetExhausted
from tdac_agent.models.provider import (
    PermanentFault,
    Provider,
    ProviderFault,
    Reply,
    Request,
)
from tdac_agent.models.retry import FailedCall, RetryPolicy, answer
from tdac_agent.models.tariff import Tariff
from tdac_agent.runs.journal_state import call_key
from tdac_agent.runs.recorder import Recorder
from tdac_agent.synthesis.options import SynthOptions
from tdac_agent.synthesis.workload import Rest, rest_of

MIN_FREE_BYTES = 16 << 20
"""Free disk space that an answer and its verification may need."""


class OutOfBudget(Exception):
    """The maximum cost of a question exceeds the remaining budget; the run ends.

    Args:
        error: Error of the budget.
        worst: Maximum cost of the question.
        rest: What may be left of the run, including the question.

    Attributes:
        way_on: Limit to resume the run with.
        outlook: Limits that suffice for the rest of the run, in one line.
    """

    def __init__(self, error: BudgetExhausted, worst: Amount, rest: Rest) -> None:
        super().__init__(str(error))
        least, whole = error.enough(worst), error.enough(rest.most)
        # Twice the minimum, so that the resumed run does not stop again at once.
        twice = error.enough(worst, times=2)
        self.way_on = min(twice, whole, key=lambda limit: limit.amount)
        self.outlook = f"at most this question is left: {least} is enough"
        if rest.questions > 1:
            self.outlook = (
                f"at most {rest.questions} questions are left: {least} is enough for "
                f"the next one, {whole} for all of them"
            )
            if self.way_on != whole:
                self.outlook += "; the suggested limit is twice the first"


@dataclass(frozen=True, slots=True)
class Calls:
    """The questions of one run; threads may ask at the same time.

    Attributes:
        recorder: Records every question and answer.
        budget: Budget of this run, or shared by several.
        tariffs: Tariffs by model name.
        retry: Retry policy after faults.
        options: Options of the synthesis.
    """

    recorder: Recorder
    budget: Budget
    tariffs: Mapping[str, Tariff]
    retry: RetryPolicy
    options: SynthOptions
    _lock: threading.Lock = field(default_factory=threading.Lock)

    @property
    def max_output(self) -> int:
        """Token limit of an answer."""
        return self.options.max_output

    def unused(self, request: Request, **facts: Any) -> None:
        """Records why an answer could not be used; see `Recorder.unused`."""
        with self._lock:
            self.recorder.unused(request, **facts)

    def ask(self, model: Provider, request: Request) -> Reply:
        """The answer to a question, from the record or from the model.

        After a truncated answer, a request may have a higher token limit than usual. If
        the model refuses that limit, it is asked again with the usual one.

        Raises:
            OutOfBudget: The maximum cost exceeds the remaining budget.
            Fault: The model did not answer; the run ends, and no iteration is used up.
        """
        with self._lock:
            request = self.recorder.numbered(request)
            limits = sorted({request.max_tokens, self.max_output}, reverse=True)
            variants = [replace(request, max_tokens=limit) for limit in limits]
            for variant in variants:
                reply = self.recorder.recall(variant, call_key(model, variant))
                if reply is not None:
                    return reply
        missed: list[FailedCall] = []
        try:
            for variant in variants[:-1]:
                try:
                    return self._answer(model, variant, missed)
                except PermanentFault:
                    continue
            return self._answer(model, variants[-1], missed)
        except ProviderFault as fault:
            number = len(missed)
            times = "" if number == 1 else f" (asked {number} times)"
            raise Fault(f"{model.name}: {fault}{times}") from None

    def _answer(
        self, model: Provider, request: Request, missed: list[FailedCall]
    ) -> Reply:
        """Asks a model with retries; each try is a call of its own."""

        def note(miss: FailedCall) -> None:
            missed.append(miss)
            worst = self.tariffs[model.name].worst(request)
            with self._lock:
                self.recorder.missed(request, call_key(model, request), miss, worst)

        return answer(lambda again: self._call(model, again), request, self.retry, note)

    def _call(self, model: Provider, request: Request) -> Reply:
        """Makes one call, within the budget and on record."""
        self._check_disk()
        recorder, tariff = self.recorder, self.tariffs[model.name]
        key, worst = call_key(model, request), tariff.worst(request)
        with self._lock:
            name = f"{recorder.run.id}/{recorder.past.next_call(key)}"
            try:
                self.budget.reserve(name, worst)
            except BudgetExhausted as error:
                raise OutOfBudget(error, worst, self._rest(request, worst)) from error
            recorder.asked(request, model.name, key, worst)
        try:
            reply = check_reply(model.complete(request))
        except ProviderFault as fault:
            if not fault.billed:
                self.budget.settle(name, NOTHING)
            raise
        spent = tariff.spent(request, reply)
        with self._lock:
            recorder.answered(request, reply, key, spent, tariff.cost(spent))
        self.budget.settle(name, spent)
        return reply

    def _rest(self, request: Request, worst: Amount) -> Rest:
        run = self.recorder.run
        return rest_of(run, self.tariffs, request, worst, self.max_output)

    def _check_disk(self) -> None:
        """Checks that there is room on the disk for an answer.

        Raises:
            Fault: The disk is nearly full.
        """
        folder = self.recorder.run.folder
        disk = os.statvfs(folder)
        left = disk.f_bavail * disk.f_frsize
        if left < MIN_FREE_BYTES:
            raise Fault(
                f"{folder}: the disk is full: {left >> 20} MB are free, "
                f"{MIN_FREE_BYTES >> 20} MB are needed for the next answer"
            )
