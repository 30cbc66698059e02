"""The contract with whatever writes controllers: a language model or `builtin`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, Protocol

from tdac_agent.verification.diagnosis.report import Report

Kind = Literal["generate", "edit", "summarise"]
Role = Literal["learner", "optimizer"]

MAX_OUTPUT_TOKENS = 16_000
"""Of an answer, thinking included; after a truncated one there may be twice as many."""
ANSWER_SECONDS = 900.0


@dataclass(frozen=True, slots=True)
class Request:
    """One question to a model.

    Attributes:
        kind: `generate` a controller, `edit` one, or `summarise` failures as rules.
        prompt: The whole question in words; all that a language model sees.
        controller: Source that failed, for `edit` and `summarise`.
        report: What failed, for `edit` and `summarise`.
        rules: Text of each rule in force.
        sample: (run, k, j), so that repeated questions stay different samples.
        stable: So many characters at the beginning of the prompt are the same in all
            questions of a run; a provider may have them cached.
        max_tokens: That an answer may have.
        seconds: That an answer may take.
        turn: How many questions of this kind for this candidate came before.
        repeat: How many questions with this very prompt came before in the run.
    """

    kind: Kind
    prompt: str
    controller: str | None = None
    report: Report | None = None
    rules: tuple[str, ...] = ()
    sample: tuple[int, int, int] = (0, 0, 0)
    stable: int = 0
    max_tokens: int = MAX_OUTPUT_TOKENS
    seconds: float = ANSWER_SECONDS
    turn: int = 0
    repeat: int = 0

    @property
    def role(self) -> Role:
        """Who is asked: the Learner (LLM1) generates, the Optimizer (LLM2) repairs."""
        return "learner" if self.kind == "generate" else "optimizer"

    @property
    def parts(self) -> tuple[str, ...]:
        """The prompt as its stable beginning and the rest; no part is empty."""
        halves = (self.prompt[: self.stable], self.prompt[self.stable :])
        return tuple(part for part in halves if part)


@dataclass(frozen=True, slots=True)
class Reply:
    """An answer.

    Attributes:
        text: As it came.
        stop: `end` for a whole answer, `length` for a truncated one, `refusal`.
        tokens_in: Tokens of the prompt, cached ones included; 0 where not reported.
        tokens_out: Tokens of the answer, thinking included; 0 where not reported.
        tokens_cached: Of `tokens_in`, those read from a cache.
        tokens_written: Of `tokens_in`, those written to a cache.
        model: As the provider reports it, if it does.
        request_id: By which the vendor knows the call, if there is one.
        notes: What the provider wants in the journal, e.g. which test changed what.
    """

    text: str
    stop: Literal["end", "length", "refusal"] = "end"
    tokens_in: int = 0
    tokens_out: int = 0
    tokens_cached: int = 0
    tokens_written: int = 0
    model: str | None = None
    request_id: str | None = None
    notes: tuple[str, ...] = field(default=())


class Provider(Protocol):
    """Answers requests; both Learner and Optimizer are providers.

    Attributes:
        name: For people and records; holds no key.
        paid: Whether an answer costs money (or much else); before the first such
            call of a run the suite has to prove itself.

    One may also have `served_at`, the address of its server if that is not the
    vendor's own, without anything secret; `missing`, what has to be had before it
    can be asked, a line each; and `recorded_seed`, with which its answers were judged.
    """

    name: str
    paid: bool

    def complete(self, request: Request) -> Reply:
        """Answers one request, once: whether it is asked again is for the caller.

        A truncated or refused answer is a `Reply`, since it is paid for; its `stop`
        says what it is. An answer without a reason why it stopped is a fault.

        Raises:
            ProviderFault: The provider cannot be reached or is broken; neither pass
                nor fail, and no iteration is used up.
        """
        ...


def served_at(model: Provider) -> str | None:
    """Address of a model's server; None for the vendor's own, or without one."""
    address: str | None = getattr(model, "served_at", None)
    return address


def recorded_seed(model: Provider) -> int | None:
    """Seed with which a recorded run was judged; None for models that are asked."""
    seed: int | None = getattr(model, "recorded_seed", None)
    return seed


def missing_for(model: Provider) -> tuple[str, ...]:
    """What has to be had before a model can be asked; nothing for most."""
    missing: tuple[str, ...] = getattr(model, "missing", ())
    return missing


class ProviderFault(Exception):
    """An infrastructure fault of a provider that may be gone the next time.

    Args:
        message: One line.
        retry_after: Seconds after which the provider wants to be asked again.

    Attributes:
        billed: Whether there may have been an answer that has to be paid for.
    """

    kind = "transient"
    billed = True

    def __init__(self, message: str, retry_after: float | None = None) -> None:
        super().__init__(message)
        self.retry_after = retry_after


class RateLimited(ProviderFault):
    """Too many requests or tokens for now."""

    kind = "rate limit"
    billed = False


class PermanentFault(ProviderFault):
    """Asking again does not help: no access, no credit, no such model, too long."""

    kind = "permanent"
    billed = False
