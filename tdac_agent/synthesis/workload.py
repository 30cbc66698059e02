"""How many questions a run may still ask, and their maximum cost."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import reduce
from typing import NamedTuple

from tdac_agent.models.budget import NOTHING, Amount
from tdac_agent.models.provider import Request
from tdac_agent.models.tariff import Tariff
from tdac_agent.models.tokens import estimate_tokens
from tdac_agent.prompting.rules import MAX_RULE_TOKENS
from tdac_agent.runs.run_record import Run
from tdac_agent.synthesis.question_kinds import (
    FASTER,
    MERGE,
    REPAIR,
    RULES,
)

FEEDBACK_TOKENS = 12_000
"""Allowance for the failures, the earlier attempts and the text around them."""

MOST_BLOCK = 32
MOST_EPISODES = 100_000
"""Most episodes of a run for one purpose."""
LEAST_IMPROVE = 32
"""Least number of episodes for improving: some variations in some episodes each."""
ASKED_FOR_ONE = 2
"""Most variations that are asked for on a task, for each one that can drive: many do
not pass the tests."""


class Shares(NamedTuple):
    """How the simulated episodes of a run are divided.

    Attributes:
        feedback: For tests of candidates on a set.
        validation: For the selection on a set.
        explore: For variations of candidates.
        block: Episodes of each of these.
        comparison: Episodes in which the improved controller and what it improves drive
            at the end.
    """

    feedback: int
    validation: int
    explore: int
    block: int
    comparison: int

    @property
    def variations(self) -> int:
        """Most variations, beside one candidate that is varied."""
        return max(0, self.explore // self.block - 1)

    @property
    def asked(self) -> int:
        """Most variations that a run asks for, if each first answer is used."""
        return self.variations * (1 if self.validation else ASKED_FOR_ONE)


def shares(episodes: int | None, improve: int = 0, race: int = 0) -> Shares:
    """Divides the episodes of a run.

    In a race, 3 of 8 episodes go to the pool, 3 of 8 to the selection, and an eighth
    each to the two controllers of the comparison. On a task they are those of
    `improve`, and half as many are for the comparison.

    Args:
        episodes: Limit of the loop on a set: half for tests, half for the selection.
            None on a task, whose tests are those of a suite.
        improve: Further episodes. An eighth of them each goes to the two controllers
            of the comparison at the end, on a set another one to the selection, and
            the others to variations.
        race: All answers of a race; 0 without one.
    """
    if race:
        whole = improve if episodes is None else episodes
        part = whole // 8
        validation = 0 if episodes is None else 3 * part
        explore = whole - 2 * part - validation
        return Shares(0, validation, explore, max(1, explore // race), part)
    part = improve // 8
    if episodes is None:
        explore = improve - 2 * part
        return Shares(0, 0, explore, _block(explore), part)
    explore, half = improve - 3 * part, episodes // 2
    return Shares(half, episodes - half + part, explore, _block(explore), part)


def _block(explore: int) -> int:
    return min(MOST_BLOCK, max(4, explore // 8))


class Workload(NamedTuple):
    """Number of questions to the Learner, to the Optimizer, and to one of the two."""

    learner: int
    optimizer: int
    either: int = 0

    @property
    def questions(self) -> int:
        """Number of all questions."""
        return self.learner + self.optimizer + self.either

    def less(self, request: Request) -> Workload:
        """The questions that follow one of them."""
        if request.role == "learner" and self.learner:
            return self._replace(learner=self.learner - 1)
        if request.role != "learner" and self.optimizer:
            return self._replace(optimizer=self.optimizer - 1)
        return self._replace(either=max(0, self.either - 1))


class Rest(NamedTuple):
    """What may be left of a run: a number of questions, and their maximum cost."""

    questions: int
    most: Amount


def of_race(answers: int, first: int, ask: str) -> Workload:
    """The most questions of a race to each of the models.

    Args:
        answers: All answers.
        first: Those that come first.
        ask: Kinds of the other questions, separated by commas.
    """
    kinds, others = set(ask.split(",")), max(0, answers - first)
    first = min(first, answers)
    if RULES in kinds:  # rules first, then a controller
        return Workload(first + others, others)
    if not kinds & {REPAIR, FASTER, MERGE}:
        return Workload(first + others, 0)
    # Without a controller to ask about, a new one is asked for.
    return Workload(first, 0, others)


def whole(
    iterations: int,
    patience: int,
    *,
    refine: bool = True,
    candidates: int = 1,
    variations: int = 0,
) -> Workload:
    """The questions of a run in which no candidate passes before the last one.

    Args:
        iterations: K.
        patience: J.
        refine: Whether failures become rules.
        candidates: N, of which one is repaired.
        variations: Most variations of what works (`Shares.asked`).
    """
    repaired = math.ceil(iterations / candidates)
    return Workload(iterations, repaired * (patience + refine), variations)


def from_here(
    request: Request,
    iterations: int,
    patience: int,
    *,
    refine: bool = True,
    candidates: int = 1,
    variations: int = 0,
) -> Workload:
    """A question and all that follow it if no candidate passes before the last one."""
    _, k, j = request.sample
    if k > iterations:
        return Workload(0, 0, max(1, variations + 1 - k + iterations))
    # Those that were asked side by side have the last k of their group.
    last = min(iterations, k + (-k) % candidates)
    terms = {"candidates": candidates, "variations": variations}
    later = whole(iterations - last, patience, refine=refine, **terms)
    left = {"generate": patience, "edit": patience - j + 1, "summarise": 0}
    mine = last - k + 1 if request.kind == "generate" else 0
    return Workload(
        later.learner + mine,
        later.optimizer + left[request.kind] + refine,
        variations,
    )


def race_from_here(request: Request, run: Run) -> Workload:
    """A question of a race and all that may follow it."""
    _, k, _ = request.sample
    first = max(0, run.candidates - k + 1)
    return of_race(max(run.iterations - k + 1, 1), first, run.ask)


def tokens_asked(question: int, max_output: int) -> Workload:
    """Tokens of a question for a controller, and of one about a controller.

    Args:
        question: Tokens of the first question, without rules.
        max_output: Token limit of an answer.
    """
    asked = question + MAX_RULE_TOKENS
    # A controller that follows a truncated one may have twice the tokens.
    return Workload(asked, asked + FEEDBACK_TOKENS + 2 * max_output)


def rest_of(
    run: Run,
    tariffs: Mapping[str, Tariff],
    request: Request,
    worst: Amount,
    max_output: int,
) -> Rest:
    """What may be left of a run from a question on, if each first answer is used.

    Args:
        run: Its models, K and J.
        tariffs: Tariffs by model name.
        request: The question.
        worst: Its maximum cost.
        max_output: Token limit of an answer.
    """
    if run.search == "race":
        left = race_from_here(request, run)
    else:
        left = from_here(
            request,
            run.iterations,
            run.patience,
            refine=run.refine,
            candidates=run.candidates,
            variations=shares(run.episodes, run.improve).asked,
        )
    size = tokens_asked(estimate_tokens(request.prompt[: request.stable]), max_output)
    if run.search == "race":  # new controllers are asked for with what is known
        size = size._replace(learner=size.optimizer)

    def one(name: str, tokens: int) -> Amount:
        tariff = tariffs[name]
        return NOTHING if tariff.free else tariff.most(tokens, max_output)

    later = left.less(request)
    both = one(run.learner, size.optimizer), one(run.optimizer, size.optimizer)
    either = Amount(max(m.tokens for m in both), max(m.usd for m in both))
    parts = (
        one(run.learner, size.learner).times(later.learner),
        both[1].times(later.optimizer),
        either.times(later.either),
    )
    return Rest(left.questions, reduce(Amount.plus, parts, worst))
