"""Whatever a child answers, the judge has a verdict, soon, and a report of it."""

from __future__ import annotations

import threading
import time
from collections import Counter

import pytest
from hostile_wire import Peer, conversations, told
from hypothesis import HealthCheck, given, settings
from small import write_small_task

from tdac_agent import load_task
from tdac_agent.episodes.episode import Record, run_own_loop, run_policy
from tdac_agent.sandbox import ControllerFault
from tdac_agent.verification.diagnosis.report import Failure

LEAST_SHARE = 0.5
MAX_STEPS = 6
MOST_TOLD = 4000


@pytest.fixture(scope="module")
def env(tmp_path_factory):
    return load_task(write_small_task(tmp_path_factory.mktemp("wire"))).make_env()


def judged(name: str, peer: Peer, env) -> list[str]:
    """What the judge says of a child, as a report would."""
    record = Record(env, None, MAX_STEPS)
    texts: list[str] = []
    try:
        peer.load()
    except ControllerFault as fault:
        return [str(fault)]
    if name == "calls":
        return _called(peer)
    if name == "policy":
        rollout = run_policy(peer, record, "x", held_out=False, deadline=float("inf"))
    else:
        late = time.monotonic() + 300.0
        rollout = run_own_loop(peer, record, "x", timeout=300.0, deadline=late)
        texts.append(told(rollout.returned))
    assert rollout.trajectory.steps <= MAX_STEPS
    assert abs(rollout.trajectory.actions).max(initial=0.0) <= 1.0
    return [*texts, rollout.error or "", rollout.outcome]


def _called(peer: Peer) -> list[str]:
    try:
        return [
            told(peer.call("OccMap2D", ([],))),
            told(peer.call("is_occupied", (1, 2))),
            told(peer.call("plan_path", ((1, 2), (3, 4)))),
            told(peer.get("LOOKAHEAD")),
        ]
    except ControllerFault as fault:
        return [str(fault)]


def check(examples: int, env) -> None:
    """Tries so many conversations; at least half of the odd moves are well-formed."""
    seen: Counter[bool] = Counter()
    threads = threading.active_count()

    @settings(
        max_examples=examples,
        suppress_health_check=list(HealthCheck),
        database=None,
        derandomize=examples < 1000,
    )
    @given(conversations())
    def run(conversation):
        name, script, at = conversation
        seen[script[at].gets_in()] += 1
        with Peer(script) as peer:
            texts = judged(name, peer, env)
        for text in texts:
            failure = Failure(test="x", group="judge", message=text)
            assert Failure.model_validate_json(failure.model_dump_json()) == failure
            assert len(text) < MOST_TOLD
            assert "\x1b" not in text

    run()
    assert threading.active_count() == threads
    share = seen[True] / seen.total()
    assert share >= LEAST_SHARE, f"only {share:.0%} of {seen.total()} are well-formed"


def test_a_hostile_answer_is_a_verdict(env):
    """100 conversations: no exception but a fault of the controller, nothing left."""
    check(100, env)


@pytest.mark.slow
def test_many_hostile_answers(env):
    """The same for 10,000."""
    check(10_000, env)
