"""The scorers of the Inspect tasks: tdac's judge."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

from anyio import from_thread, to_thread
from inspect_ai.scorer import (
    Metric,
    SampleScore,
    Score,
    Scorer,
    Target,
    accuracy,
    mean,
    metric,
    scorer,
)
from inspect_ai.solver import TaskState
from inspect_ai.util import concurrency

from tdac_agent.evaluation.policies import Entrant
from tdac_agent.falsify.falsify import SearchPlan, falsify
from tdac_agent.inspect_tasks.names import registered
from tdac_agent.problems.problem import Poll
from tdac_agent.prompting.extract import POLICY, Answer, read_answer
from tdac_agent.runs.falsification import Falsification
from tdac_agent.runs.falsify_text import summary_of
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.synthesis.answers import Exam, exam_of, unusable
from tdac_agent.synthesis.candidates import raw
from tdac_agent.verification.judge.policy_spec import PolicySpec

T = TypeVar("T")
JUDGES = 1
"""Judges at a time: one may use all cores."""
NO_CODE = "invalid_response_format"
"""Inspect's word for an answer that cannot be used."""


@metric(name=registered("stderr_of_worlds"))
def stderr_of_worlds() -> Metric:
    """Standard error of the share of worlds reached.

    Its unit is the world, not the sample as in Inspect's `stderr`: a level has one
    sample, whose answers all drive on the same worlds.
    """

    def compute(scores: list[SampleScore]) -> float:
        shares = [each.score.as_float() for each in scores]
        worlds = [(each.sample_metadata or {})["worlds"] for each in scores]
        spread = sum(
            share * (1.0 - share) / count
            for share, count in zip(shares, worlds, strict=True)
        )
        return math.sqrt(spread) / len(scores) if scores else 0.0

    return compute


@scorer(metrics=[accuracy()], name=registered("passed"))
def passed() -> Scorer:
    """1 if the controller in the answer passes the tests of its task, otherwise 0."""

    async def score(state: TaskState, target: Target) -> Score:  # noqa: ARG001
        scores, rest = await _judged(state)
        return Score(value=scores.get("passed", 0.0), **rest)

    return score


@scorer(
    metrics={"success": [mean(), stderr_of_worlds()], "time": [mean()]},
    name=registered("driven"),
)
def driven() -> Scorer:
    """The share of worlds that the controller reached, and its mean time score."""

    async def score(state: TaskState, target: Target) -> Score:  # noqa: ARG001
        scores, rest = await _judged(state)
        return Score(value={"success": 0.0, "time": 0.0} | scores, **rest)

    return score


def answer_of(state: TaskState) -> Answer:
    """The controller in the last answer, or what is wrong with the answer."""
    ended = state.output.stop_reason == "stop"
    return read_answer(state.output.completion, (POLICY,), ended=ended)


async def in_thread(state: TaskState, work: Callable[[Exam, Poll], T]) -> T:
    """Does the judge's work on a sample in a thread, while others wait for theirs.

    A sample that is cancelled ends it.

    Args:
        state: State of the sample.
        work: Called with the sample's exam, and with a function to call repeatedly.

    Raises:
        Fault: The judge or its sandbox is broken. For Inspect this is an error of the
            sample, neither a pass nor a failure.
    """

    def called() -> T:
        return work(exam_of(state.metadata), from_thread.check_cancelled)

    async with concurrency("tdac judge", JUDGES):
        return await to_thread.run_sync(called)


async def _judged(state: TaskState) -> tuple[dict[str, float], dict[str, Any]]:
    """The scores of the last answer, none if it has no code; the rest of its score."""
    source, problem = answer_of(state)
    if source is None:
        return {}, {"explanation": unusable(problem), "reason": NO_CODE}
    judged = await in_thread(state, lambda exam, poll: exam.judge(raw(source), poll))
    told, facts = judged.feedback, judged.facts
    episodes = (state.metadata or {}).get("envelope", 0)
    if episodes and judged.scores.get("passed") == 1.0:
        found = await in_thread(
            state, lambda exam, poll: _envelope(exam, source, episodes, poll)
        )
        told = f"{told}\n{summary_of(found)}".strip()
        facts = {**facts, "envelope": found.model_dump(mode="json")}
    rest = {"answer": source, "explanation": told, "metadata": facts}
    return judged.scores, rest


def _envelope(exam: Exam, source: str, episodes: int, poll: Poll) -> Falsification:
    """The smallest deviation with which a controller fails on its task."""
    assert exam.problem.task is not None
    content = raw(source)
    entrant = Entrant(
        "answer",
        PolicySpec("controller"),
        sha256_of(content),
        "controller",
        source=content,
    )
    plan = SearchPlan(episodes=episodes)
    return falsify(entrant, exam.problem.task, plan, watch=lambda _count: poll())
