"""The one place through which every question to a model passes.

A question that is on record is answered from there. Of any other the most that it can
cost is reserved; it is written down, then asked, and what it took is settled.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace

from tdac_agent.errors import Fault
from tdac_agent.models.budget import NOTHING, Amount, Budget, BudgetExhausted
from tdac_agent.models.provider import (
    MAX_OUTPUT_TOKENS,
    PermanentFault,
    Provider,
    ProviderFault,
    Reply,
    Request,
)
from tdac_agent.models.retry import Missed, RetryPolicy, answer
from tdac_agent.models.tariff import Tariff
from tdac_agent.runs.past import call_key
from tdac_agent.runs.recorder import Recorder
from tdac_agent.synthesis.workload import Rest, rest_of

MIN_FREE_BYTES = 16 << 20
"""On the disk before a question: what an answer and its verification may need."""


class OutOfBudget(Exception):
    """The worst case of a question is more than what is left; the run ends here.

    Args:
        error: Of the budget.
        worst: That the question can take.
        rest: Of the run, the question included.

    Attributes:
        way_on: The flag with which the run can go on.
        outlook: What that is to be measured by, in a line.
    """

    def __init__(self, error: BudgetExhausted, worst: Amount, rest: Rest) -> None:
        super().__init__(str(error))
        least, whole = error.flag(worst), error.flag(rest.most)
        # Twice what is needed at least, so that it does not stop at once again.
        twice = error.flag(worst, times=2)
        self.way_on = min(twice, whole, key=lambda flag: float(flag.split()[1]))
        self.outlook = f"at most this question is left: {least} is enough"
        if rest.questions > 1:
            self.outlook = (
                f"at most {rest.questions} questions are left: {least} is enough for "
                f"the next one, {whole} for all of them"
            )
            if self.way_on != whole:
                self.outlook += "; to go on, twice the first is proposed"


@dataclass(frozen=True, slots=True)
class Calls:
    """The questions of one run.

    Attributes:
        recorder: Keeps every question and answer.
        budget: Of this run, or of several.
        tariffs: By the names of the models.
        retry: How patiently a model is asked.
        max_output: Tokens that an answer may have.
    """

    recorder: Recorder
    budget: Budget
    tariffs: Mapping[str, Tariff]
    retry: RetryPolicy
    max_output: int = MAX_OUTPUT_TOKENS

    def ask(self, model: Provider, request: Request) -> Reply:
        """The answer to a question, from the record or from the model.

        Not every model may give as long an answer as one is allowed that was truncated
        before: where that is refused, it is asked for one of the usual length.

        Raises:
            OutOfBudget: There is not enough left for the worst case.
            Fault: It did not answer; the run ends, and no iteration is used up.
        """
        request = self.recorder.numbered(request)
        rooms = sorted({request.max_tokens, self.max_output}, reverse=True)
        variants = [replace(request, max_tokens=room) for room in rooms]
        for variant in variants:
            reply = self.recorder.recall(variant, call_key(model, variant))
            if reply is not None:
                return reply
        missed: list[Missed] = []
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

    def _answer(self, model: Provider, request: Request, missed: list[Missed]) -> Reply:
        """Asks a model again and again; each time is a call of its own."""

        def note(miss: Missed) -> None:
            missed.append(miss)
            worst = self.tariffs[model.name].worst(request)
            self.recorder.missed(request, call_key(model, request), miss, worst)

        return answer(lambda again: self._call(model, again), request, self.retry, note)

    def _call(self, model: Provider, request: Request) -> Reply:
        """One call, within the budget and on record."""
        self._check_disk()
        recorder, tariff = self.recorder, self.tariffs[model.name]
        key, worst = call_key(model, request), tariff.worst(request)
        name = f"{recorder.run.id}/{recorder.past.next_call(key)}"
        try:
            self.budget.reserve(name, worst)
        except BudgetExhausted as error:
            raise OutOfBudget(error, worst, self._rest(request, worst)) from error
        recorder.asked(request, model.name, key, worst)
        try:
            reply = model.complete(request)
        except ProviderFault as fault:
            if not fault.billed:
                self.budget.settle(name, NOTHING)
            raise
        spent = tariff.spent(request, reply)
        recorder.answered(request, reply, key, spent, tariff.cost(spent))
        self.budget.settle(name, spent)
        return reply

    def _rest(self, request: Request, worst: Amount) -> Rest:
        run = self.recorder.run
        return rest_of(run, self.tariffs, request, worst, self.max_output)

    def _check_disk(self) -> None:
        """Refuses to ask where an answer could not be kept.

        Raises:
            Fault: The disk is nearly full.
        """
        folder = self.recorder.run.folder
        disk = os.statvfs(folder)
        left = disk.f_bavail * disk.f_frsize
        if left < MIN_FREE_BYTES:
            raise Fault(
                f"{folder}: the disk is full: {left >> 20} MB are left, "
                f"{MIN_FREE_BYTES >> 20} MB are needed to keep what comes"
            )
