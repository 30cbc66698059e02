"""The one place through which every question to a model passes."""

from __future__ import annotations

from tdac_agent.errors import Fault
from tdac_agent.provider import Provider, ProviderFault, Reply, Request
from tdac_agent.records import Recorder
from tdac_agent.retry import Missed, RetryPolicy, answer


def ask(
    model: Provider, request: Request, recorder: Recorder, policy: RetryPolicy
) -> Reply:
    """Asks a model, and keeps question, faults and answer.

    Raises:
        Fault: It did not answer; the run ends, and no iteration is used up.
    """
    recorder.asked(request, model.name)
    missed: list[Missed] = []

    def note(miss: Missed) -> None:
        missed.append(miss)
        recorder.missed(request, miss)

    try:
        reply = answer(model, request, policy, note)
    except ProviderFault as fault:
        number = len(missed)
        times = "" if number == 1 else f" (asked {number} times)"
        raise Fault(f"{model.name}: {fault.kind} fault: {fault}{times}") from None
    recorder.answered(request, reply)
    return reply
