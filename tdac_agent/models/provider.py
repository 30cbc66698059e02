"""The interface of everything that writes controllers: language models, `builtin`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, Protocol, cast

from tdac_agent.verification.diagnosis.report import Report

Kind = Literal["generate", "edit", "summarise", "improve"]
Role = Literal["learner", "optimizer"]
MAX_OUTPUT_TOKENS = 16_000
"""Limit of an answer, thinking included; doubled after a truncated answer."""
ANSWER_SECONDS = 900.0


@dataclass(frozen=True, slots=True)
class Request:
    """One question to a model.

    Attributes:
        kind: `generate` a controller, `edit` a failed one, `summarise` failures as
            rules, or `improve` a controller that works.
        prompt: The whole question; a language model sees nothing else.
        controller: Source that failed, for `edit` and `summarise`; source to `improve`.
        report: Report on the failure, for `edit` and `summarise`.
        rules: Text of each repair rule in force.
        sample: Indices of run, iteration k and repair j; they make repeated questions
            different samples.
        stable: Number of characters at the start of the prompt that are the same in
            all questions of a run; a provider may cache them.
        max_tokens: Token limit of the answer.
        seconds: Time limit of the answer.
        turn: Number of earlier questions of this kind for this candidate.
        repeat: Number of earlier questions with the same prompt in this run.
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
        """Role to ask: the Learner (LLM1) generates, the Optimizer (LLM2) repairs."""
        return "learner" if self.kind == "generate" else "optimizer"

    @property
    def parts(self) -> tuple[str, ...]:
        """The stable beginning of the prompt and the rest; empty parts are left out."""
        halves = (self.prompt[: self.stable], self.prompt[self.stable :])
        return tuple(part for part in halves if part)


@dataclass(frozen=True, slots=True)
class Reply:
    """An answer.

    Attributes:
        text: Text of the answer.
        stop: `end` for a complete answer, `length` for a truncated one, or `refusal`.
        tokens_in: Tokens of the prompt, cached ones included; 0 if not reported.
        tokens_out: Tokens of the answer, thinking included; 0 if not reported.
        tokens_cached: Part of `tokens_in` that was read from a cache.
        tokens_written: Part of `tokens_in` that was written to a cache.
        model: The model's name as reported, if it is.
        request_id: The vendor's ID of the call, if it has one.
        notes: Lines for the journal, e.g. which test changed which parameter.
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


class Author(Protocol):
    """Who writes controllers, for the record of a run."""

    @property
    def name(self) -> str:
        """Name in messages and records; must not contain a key."""


class Provider(Protocol):
    """Answers requests; both Learner and Optimizer are providers.

    Attributes:
        name: Name in messages and records; must not contain a key.
        paid: Whether an answer costs money or other effort; before the first paid
            call of a run the test suite is checked.

    A provider may also have `served_at`, the URL of its server without secrets (None
    for the vendor's own); `missing`, a line for each thing that it still needs;
    `recorded_seed`, the seed with which its recorded answers were judged; `fixed`,
    whether it gives the same controller whatever it is asked; and `concurrent`, whether
    threads may ask it at the same time.
    """

    name: str
    paid: bool

    def complete(self, request: Request) -> Reply:
        """Answers one request, without retries: the caller decides about those.

        A truncated or refused answer is paid for, so it is a `Reply` with `stop` set
        to `length` or `refusal`. An answer without a stop reason is a fault.

        Raises:
            ProviderFault: The provider cannot be reached or is broken. This is neither
                a pass nor a fail, and uses up no iteration.
        """
        ...


def served_at(model: Author) -> str | None:
    """Returns the URL of a model's server; None for the vendor's own or no server."""
    return cast("str | None", getattr(model, "served_at", None))


def recorded_seed(model: Provider) -> int | None:
    """Returns the seed with which a replayed run was judged; None for other models."""
    return cast("int | None", getattr(model, "recorded_seed", None))


def is_fixed(model: Provider) -> bool:
    """Returns whether a model gives the same controller whatever it is asked."""
    return cast("bool", getattr(model, "fixed", False))


def is_concurrent(model: Provider) -> bool:
    """Returns whether threads may ask a model at the same time."""
    return cast("bool", getattr(model, "concurrent", False))


def missing_for(model: Provider) -> tuple[str, ...]:
    """Returns a line for each thing that a model still needs before it can be asked."""
    return cast("tuple[str, ...]", getattr(model, "missing", ()))


class ProviderFault(Exception):
    """An infrastructure fault of a provider; transient unless a subclass differs.

    Args:
        message: One line.
        retry_after: Seconds that the provider asks to wait before a retry.

    Attributes:
        billed: Whether the call may have been billed.
    """

    kind = "transient"
    billed = True

    def __init__(self, message: str, retry_after: float | None = None) -> None:
        super().__init__(message)
        self.retry_after = retry_after


class RateLimited(ProviderFault):
    """The provider's rate limit was reached."""

    kind = "rate limit"
    billed = False


class PermanentFault(ProviderFault):
    """A retry does not help: no access, no credit, no such model, prompt too long."""

    kind = "permanent"
    billed = False
