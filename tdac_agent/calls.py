"""The one place through which every question to a model passes."""

from __future__ import annotations

from dataclasses import replace

from tdac_agent.errors import Fault
from tdac_agent.provider import (
    MAX_OUTPUT_TOKENS,
    PermanentFault,
    Provider,
    ProviderFault,
    Reply,
    Request,
)
from tdac_agent.records import Recorder
from tdac_agent.retry import Missed, RetryPolicy, answer


def ask(
    model: Provider, request: Request, recorder: Recorder, policy: RetryPolicy
) -> Reply:
    """Asks a model, and keeps question, faults and answer.

    Not every model may give as long an answer as one is allowed that was truncated
    before: where that is refused, it is asked for one of the usual length.

    Raises:
        Fault: It did not answer; the run ends, and no iteration is used up.
    """
    recorder.asked(request, model.name)
    missed: list[Missed] = []

    def note(miss: Missed) -> None:
        missed.append(miss)
        recorder.missed(request, miss)

    try:
        try:
            reply = answer(model, request, policy, note)
        except PermanentFault:
            if request.max_tokens <= MAX_OUTPUT_TOKENS:
                raise
            usual = replace(request, max_tokens=MAX_OUTPUT_TOKENS)
            reply = answer(model, usual, policy, note)
    except ProviderFault as fault:
        number = len(missed)
        times = "" if number == 1 else f" (asked {number} times)"
        raise Fault(f"{model.name}: {fault.kind} fault: {fault}{times}") from None
    recorder.answered(request, reply)
    return reply
