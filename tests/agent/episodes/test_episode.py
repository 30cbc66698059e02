"""What is reckoned of one episode."""

import math
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tdac_agent.episodes.episode import Record, late, run_policy
from tdac_agent.sandbox import ControllerFault
from tdac_envs.drive.task import AT_START
from tdac_envs.ladder.env import make
from tdac_envs.map2d.env import Map2DEnv

TIMES = st.floats(0.0, 1e4)


@given(arrays(np.float64, st.integers(1, 300), elements=TIMES))
def test_the_late_calls_are_numpys_percentile(times):
    """Between two calls where the percentile falls between them."""
    assert late(times) == pytest.approx(float(np.percentile(times, 99)))


class Exhausted:
    """A policy that takes long, and runs out of memory in its second call."""

    def reset(self, observation):
        self.calls = 0

    def policy(self, observation):
        self.calls += 1
        if self.calls == 2:
            raise ControllerFault("MemoryError at policy (line 3)", "policy")
        time.sleep(0.2)
        return 0.0, 0.0

    def waited(self):
        return 0.0


def test_an_error_after_a_long_call_is_no_time_out():
    """The mean call took longer than a step, but that is not why it ended."""
    env = Map2DEnv(np.zeros((60, 60), bool), (10, 10, 0), (50, 50), robot_radius=3)
    record = Record(env, None, 100)
    rollout = run_policy(Exhausted(), record, "one", held_out=False, deadline=math.inf)
    assert rollout.outcome == "error"
    assert rollout.error == "MemoryError at policy (line 3)"
    assert not rollout.timed_out
    assert not rollout.is_retryable


def test_a_controller_is_not_told_its_world():
    """What a reset says about a public world stays with the judge."""
    env = make("unknown", split="dev", privileged=True)
    assert set(AT_START) < set(env.reset(options={"index": 2})[1])
    record = Record(env, None, 100, options={"index": 2})
    info = record.reset()[1]
    assert not set(AT_START) & set(info)
    assert not set(AT_START) & set(record.step((0.0, 0.0))[4])
