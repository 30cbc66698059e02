"""What a run may still ask, and what that may take, before it is asked."""

from pathlib import Path

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tdac_agent.models.budget import NOTHING, Amount, Budget, BudgetExhausted
from tdac_agent.models.prices import Price
from tdac_agent.models.provider import Request
from tdac_agent.models.tariff import Tariff
from tdac_agent.runs.run_record import Run
from tdac_agent.synthesis.calls import OutOfBudget
from tdac_agent.synthesis.question_kinds import KINDS
from tdac_agent.synthesis.workload import (
    LEAST_IMPROVE,
    Rest,
    from_here,
    of_race,
    race_from_here,
    rest_of,
    shares,
    whole,
)

TARIFFS = {
    "dear": Tariff(price=Price(input=10, output=50)),
    "cheap": Tariff(price=Price(input=1, output=2)),
    "unknown": Tariff(),
    "free": Tariff(free=True),
}


def all_questions(iterations, patience):
    """Kind, k and j of every question, as the loop puts them if nothing passes."""
    for k in range(1, iterations + 1):
        yield "generate", k, 0
        yield from (("edit", k, j) for j in range(1, patience + 1))
        yield "summarise", k, patience


def request(kind, k, j, prompt="x" * 300):
    return Request(kind, prompt, sample=(0, k, j), stable=200, max_tokens=1000)


def run_of(learner, optimizer, iterations, patience):
    return Run(
        folder=Path("run"),
        task="t",
        task_sha256="",
        learner=learner,
        optimizer=optimizer,
        iterations=iterations,
        patience=patience,
        seed=0,
        started="",
    )


@settings(deadline=None)
@given(st.integers(1, 6), st.integers(0, 4), st.booleans())
def test_the_questions_that_are_left(iterations, patience, refine):
    """From each question on, those that the loop would put; from the first, all."""
    every = all_questions(iterations, patience)
    questions = [place for place in every if refine or place[0] != "summarise"]
    assert whole(iterations, patience, refine=refine).questions == len(questions)
    for number, place in enumerate(questions):
        left = questions[number:]
        learner = sum(kind == "generate" for kind, _, _ in left)
        expected = (learner, len(left) - learner, 0)
        left_now = from_here(request(*place), iterations, patience, refine=refine)
        assert left_now == expected


names = st.sampled_from(list(TARIFFS))


@settings(deadline=None)
@given(names, names, st.integers(1, 4), st.integers(0, 3), st.data())
def test_the_rest_of_a_run(learner, optimizer, iterations, patience, data):
    """It is at least the next question, shrinks to it, and is free where all is."""
    run = run_of(learner, optimizer, iterations, patience)
    rests = []
    for place in all_questions(iterations, patience):
        asked = request(*place)
        model = learner if asked.role == "learner" else optimizer
        worst = TARIFFS[model].worst(asked)
        rest = rest_of(run, TARIFFS, asked, worst, 1000)
        assert rest.most.usd >= worst.usd
        assert rest.most.tokens >= worst.tokens
        rests.append(rest)
    assert [rest.questions for rest in rests] == list(range(len(rests), 0, -1))
    last_kind = TARIFFS[optimizer].worst(request("summarise", 1, 0))
    assert rests[-1].most == last_kind
    if learner == optimizer == "free":
        assert {rest.most for rest in rests} == {NOTHING}


def exhausted(limit, taken, worst, rest):
    """What is said where a budget is too small for a question."""
    budget = Budget(**limit)
    budget.restore({"before": taken})
    with pytest.raises(BudgetExhausted) as caught:
        budget.reserve("next", worst)
    return OutOfBudget(caught.value, worst, rest)


MONEY = {"max_cost": 0.15}
SPENT, NEXT = Amount(12000, 0.06), Amount(9000, 0.113)


def test_what_is_enough_for_what():
    """The least for the next question, all for the rest, and something between."""
    told = exhausted(MONEY, SPENT, NEXT, Rest(58, Amount(10**6, 12.111)))
    assert str(told.way_on) == "--max-cost 0.35"
    assert told.outlook == (
        "at most 58 questions are left: --max-cost 0.18 is enough for the next one, "
        "--max-cost 12.18 for all of them; the suggested limit is twice the first"
    )
    told = exhausted({"max_tokens": 20_000}, SPENT, NEXT, Rest(2, Amount(40_000, 0)))
    assert str(told.way_on) == "--max-tokens 42000"
    assert "--max-tokens 21000 is enough for the next one" in told.outlook
    assert "--max-tokens 52000 for all of them" in told.outlook
    told = exhausted({"max_tokens": 20_000}, SPENT, NEXT, Rest(2, Amount(10_000, 0)))
    assert str(told.way_on) == "--max-tokens 22000"
    assert told.outlook.endswith("--max-tokens 22000 for all of them")


def test_no_more_is_named_than_can_be_taken():
    """The last question of a run needs no more than itself."""
    told = exhausted(MONEY, SPENT, NEXT, Rest(1, NEXT))
    assert str(told.way_on) == "--max-cost 0.18"
    assert told.outlook == "at most this question is left: --max-cost 0.18 is enough"


amounts = st.floats(0.0001, 5)


@settings(deadline=None)
@given(amounts, amounts, amounts, amounts)
def test_what_is_said_to_be_enough_is(limit, spent, worst, more):
    """With each flag that is named the question fits, and none goes beyond the rest."""
    assume(spent + worst > limit + 1e-6)
    taken, next_one = Amount(usd=spent), Amount(usd=worst)
    rest = Rest(2, Amount(usd=worst + more))
    told = exhausted({"max_cost": limit}, taken, next_one, rest)
    for flag in (str(told.way_on), *told.outlook.split("--max-cost ")[1:]):
        enough = float(flag.removeprefix("--max-cost ").split()[0].rstrip(";"))
        assert enough <= spent + worst + more + 0.011
        budget = Budget(max_cost=enough)
        budget.restore({"before": taken})
        budget.reserve("next", next_one)


KINDS_OF_OPTIMIZER = {"repair", "faster", "merge"}


@st.composite
def races(draw):
    """Answers, first answers, kinds, and the kinds of the questions that came."""
    answers, first = draw(st.integers(1, 9)), draw(st.integers(1, 10))
    asked = draw(st.lists(st.sampled_from(KINDS), min_size=1, unique=True))
    later = max(0, answers - first)
    came = draw(st.lists(st.sampled_from(asked), min_size=later, max_size=later))
    return answers, first, ",".join(asked), came


def race_questions(answers, first, came):
    """The questions of a race in which each answer can be used."""
    first = min(answers, first)
    for k in range(1, first + 1):
        yield request("generate", k, 0)
    for k, kind in enumerate(came, first + 1):
        if kind == "rules":
            yield request("summarise", k, 0)
        yield request("improve" if kind in KINDS_OF_OPTIMIZER else "generate", k, 0)


def is_bound(work, questions):
    """Whether a workload has at least these questions, for each of the models."""
    learner = sum(each.role == "learner" for each in questions)
    optimizer = len(questions) - learner
    spare = max(0, learner - work.learner) + max(0, optimizer - work.optimizer)
    return spare <= work.either and work.questions >= len(questions)


@settings(deadline=None)
@given(races(), names, names)
def test_a_race_asks_no_more_than_is_said(race, learner, optimizer):
    """For each model, from the first question and from each of the others."""
    answers, first, ask, came = race
    questions = list(race_questions(answers, first, came))
    assert is_bound(of_race(answers, first, ask), questions)
    facts = {"search": "race", "candidates": first, "ask": ask}
    run = run_of(learner, optimizer, answers, 0).model_copy(update=facts)
    for number, asked in enumerate(questions):
        assert is_bound(race_from_here(asked, run), questions[number:])
        model = learner if asked.role == "learner" else optimizer
        worst = TARIFFS[model].worst(asked)
        rest = rest_of(run, TARIFFS, asked, worst, 1000)
        assert rest.questions >= len(questions) - number
        parts = [TARIFFS[optimizer if q.role != "learner" else learner].worst(q)
                 for q in questions[number:]]  # fmt: skip
        assert rest.most.usd >= sum(part.usd for part in parts) - 1e-9
        assert rest.most.tokens >= sum(part.tokens for part in parts)


@settings(deadline=None)
@given(st.integers(1, 6), st.integers(1, 9), st.data(), names, names)
def test_variations_ask_either_model(iterations, variations, data, learner, optimizer):
    """A variation may be asked of the learner; the dearer model bounds its cost."""
    run = run_of(learner, optimizer, iterations, 1).model_copy(
        update={"improve": 64, "episodes": None}
    )
    kinds = st.sampled_from(["improve", "generate"])
    came = data.draw(st.lists(kinds, min_size=variations, max_size=variations))
    questions = [request(kind, iterations + n, 0) for n, kind in enumerate(came, 1)]
    terms = {"variations": variations}
    work = whole(iterations, 1, **terms)
    loop = [request(*place) for place in all_questions(iterations, 1)]
    assert is_bound(work, [*loop, *questions])
    assert work.questions == len(loop) + variations
    for number, asked in enumerate(questions):
        left = from_here(asked, iterations, 1, **terms)
        assert left.questions == variations - number
        assert is_bound(left, questions[number:])
        model = learner if asked.role == "learner" else optimizer
        worst = TARIFFS[model].worst(asked)
        rest = rest_of(run, TARIFFS, asked, worst, 1000)
        assert rest.most.usd >= worst.usd


@given(
    st.none() | st.integers(2, 10_000),
    st.integers(LEAST_IMPROVE, 10_000),
    st.integers(1, 60),
)
def test_shares_of_a_race(episodes, improve, answers):
    """They are all episodes; the pool has at least one, and all pools fit."""
    parts = shares(episodes, improve, answers)
    known = improve if episodes is None else episodes
    used = parts.feedback + parts.validation + parts.explore + 2 * parts.comparison
    assert used == known
    assert parts.feedback == 0
    assert (parts.validation == 0) == (episodes is None or episodes < 8)
    assert parts.block >= 1
    assert parts.block * min(answers, parts.explore) <= parts.explore
    if parts.validation:
        assert parts.validation == 3 * parts.comparison
