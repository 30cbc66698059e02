"""How many questions a run may still put, and what all of them may take."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from tdac_agent.models.budget import NOTHING, Amount
from tdac_agent.models.provider import Request
from tdac_agent.models.tariff import Tariff
from tdac_agent.models.tokens import estimate_tokens
from tdac_agent.prompting.rules import MAX_RULE_TOKENS
from tdac_agent.runs.records import Run

FEEDBACK_TOKENS = 12_000
"""Room for what failed, the earlier attempts and the words around them."""


class Workload(NamedTuple):
    """Questions to the Learner, and to the Optimizer."""

    learner: int
    optimizer: int

    @property
    def questions(self) -> int:
        """All of them."""
        return self.learner + self.optimizer


class Rest(NamedTuple):
    """What may be left of a run: so many questions, which take so much at most."""

    questions: int
    most: Amount


def whole(iterations: int, patience: int, *, refine: bool = True) -> Workload:
    """The questions of a run in which nothing ever passes."""
    return Workload(iterations, iterations * (patience + refine))


def from_here(
    request: Request, iterations: int, patience: int, *, refine: bool = True
) -> Workload:
    """A question, and all that may come after it where nothing ever passes."""
    _, k, j = request.sample
    later = whole(iterations - k, patience, refine=refine)
    left = {"generate": patience, "edit": patience - j + 1, "summarise": 0}
    return Workload(
        later.learner + (request.kind == "generate"),
        later.optimizer + left[request.kind] + refine,
    )


def tokens_asked(question: int, max_output: int) -> Workload:
    """Tokens of a question for a controller, and of one about a controller.

    Args:
        question: Of the first one, without rules.
        max_output: That an answer may have.
    """
    asked = question + MAX_RULE_TOKENS
    # A controller that was cut off may have twice the tokens when it comes.
    return Workload(asked, asked + FEEDBACK_TOKENS + 2 * max_output)


def rest_of(
    run: Run,
    tariffs: Mapping[str, Tariff],
    request: Request,
    worst: Amount,
    max_output: int,
) -> Rest:
    """What a run may take from a question on, each being answered at once.

    Args:
        run: Its models, K and J.
        tariffs: By the names of the models.
        request: The question.
        worst: That it may take.
        max_output: Tokens that an answer may have.
    """
    left = from_here(request, run.iterations, run.patience, refine=run.refine)
    tokens = tokens_asked(estimate_tokens(request.prompt[: request.stable]), max_output)
    this = Workload(1, 0) if request.role == "learner" else Workload(0, 1)
    most = worst
    models = (run.learner, run.optimizer)
    for name, count, mine, size in zip(models, left, this, tokens, strict=True):
        tariff = tariffs[name]
        one = NOTHING if tariff.free else tariff.most(size, max_output)
        most = most.plus(one.times(count - mine))
    return Rest(left.questions, most)
