"""The contract with whatever writes controllers: a language model or `builtin`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, Protocol

from tdac_agent.report import Report

Kind = Literal["generate", "edit", "summarise"]


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
    """

    kind: Kind
    prompt: str
    controller: str | None = None
    report: Report | None = None
    rules: tuple[str, ...] = ()
    sample: tuple[int, int, int] = (0, 0, 0)


@dataclass(frozen=True, slots=True)
class Reply:
    """An answer.

    Attributes:
        text: As it came.
        stop: `end` for a whole answer, `length` for a truncated one, `refusal`.
        tokens_in: Tokens of the prompt, 0 where no model was asked.
        tokens_out: Tokens of the answer.
        notes: What the provider wants in the journal, e.g. which test changed what.
    """

    text: str
    stop: Literal["end", "length", "refusal"] = "end"
    tokens_in: int = 0
    tokens_out: int = 0
    notes: tuple[str, ...] = field(default=())


class Provider(Protocol):
    """Answers requests; both Learner and Optimizer are providers.

    Attributes:
        name: For people and records.
        paid: Whether an answer costs money (or much else); before the first such
            call of a run the suite has to prove itself.
    """

    name: str
    paid: bool

    def complete(self, request: Request) -> Reply:
        """Answers one request.

        Raises:
            ProviderFault: The provider cannot be reached or is broken; neither pass
                nor fail, and no iteration is used up.
        """
        ...


class ProviderFault(Exception):
    """An infrastructure fault of a provider."""
