"""A machine that is busy with other work makes no verdict."""

import os
import time
from pathlib import Path

import pytest
from small import SHORT, write_small_task

from tdac_agent import load_task
from tdac_agent.episodes.episode import Record, run_policy
from tdac_agent.sandbox import ControllerTimeout, Limits
from tdac_agent.tasks.task import write_workdir
from tdac_agent.verification.judge.judge import Judge

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/schedstat").exists(), reason="the kernel does not tell"
)
BUSY = """
import time

def policy(obs):
    end = time.process_time() + obs
    while time.process_time() < end:
        pass
    return (0.0, 0.0)
"""
IDLE = """
import threading

def policy(obs):
    threading.Event().wait(obs)
    return (0.0, 0.0)
"""
LIMITS = Limits(call_seconds=1.0, import_seconds=60.0, start_seconds=60.0)


@pytest.fixture
def crowded(loaded, crowd, tier):
    """Starts children on the crowded CPU."""

    def start(source):
        child = loaded(source, tier=tier, limits=LIMITS)
        os.sched_setaffinity(child.controller_pid, {crowd})
        return child

    return start


@pytest.mark.slow
def test_standing_in_line_for_a_cpu_is_not_the_controllers_time(crowded):
    """0.6 s of work are within a second, however long they take by the clock."""
    child = crowded(BUSY)
    before = child.waited()
    assert child.policy(0.6) == (0.0, 0.0)
    # How much of the CPU it gets beside the others is up to the system.
    assert child.waited() - before > 0.05


@pytest.mark.slow
def test_on_a_busy_machine_too_much_work_is_too_much(crowded):
    """Two seconds of work are more than one, and would be at every other time."""
    with pytest.raises(ControllerTimeout, match="policy") as caught:
        crowded(BUSY).policy(2.0)
    assert not caught.value.is_retryable


@pytest.mark.slow_after(1)
def test_on_a_busy_machine_sleeping_is_the_controllers_time(crowded):
    """A controller that waits is not in line; what for, nobody knows."""
    with pytest.raises(ControllerTimeout, match="policy") as caught:
        crowded(IDLE).policy(30.0)
    assert caught.value.is_retryable


class Thinking:
    """A policy in the judge's process that stands still.

    Args:
        seconds: Of CPU that a call needs.
    """

    def __init__(self, seconds):
        self.seconds = seconds

    def reset(self, observation):
        pass

    def policy(self, observation):
        end = time.thread_time() + self.seconds
        while time.thread_time() < end:
            pass
        return (0.0, 0.0)

    def waited(self):
        return 0.0


@pytest.fixture
def judged_in_the_crowd(tmp_path, crowd):
    """Has a policy drive an episode of 50 steps of 20 ms, in a process in a crowd."""
    task = load_task(write_small_task(tmp_path, **SHORT, horizon=50))
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {crowd})
    yield lambda driver: run_policy(
        driver,
        Record(task.make_env(), None, 50),
        "nominal",
        held_out=False,
        deadline=float("inf"),
    )
    os.sched_setaffinity(0, before)


@pytest.mark.slow
def test_where_the_judge_stands_in_line_no_policy_is_slow(judged_in_the_crowd):
    """15 ms of work a call are within a step, however long the judge waits for a CPU.

    By the clock they are more than the 40 ms at which a policy is cut off.
    """
    rollout = judged_in_the_crowd(Thinking(0.015))
    assert (rollout.outcome, rollout.error) == ("out of time", None)
    assert not rollout.timed_out
    assert rollout.calls.mean() > 0.04


@pytest.mark.slow
def test_on_a_busy_machine_a_slow_policy_is_slow(judged_in_the_crowd):
    """60 ms of work a call are too much in steps of 20 ms."""
    rollout = judged_in_the_crowd(Thinking(0.06))
    assert rollout.outcome == "error"
    assert "ms a call, 20 ms are allowed" in rollout.error
    assert rollout.timed_out


LOOP = """
import time

def run_episode(env, max_steps):
    for _ in range(max_steps):
        end = time.process_time() + 0.03
        while time.process_time() < end:
            pass
        env.step((0.0, 0.0))
"""


@pytest.mark.slow
def test_a_verification_that_is_starved_has_no_verdict(crowd, tmp_path):
    """Its time is up because of other work: a fault, where a sleeper's is a failure."""
    task = load_task(write_small_task(tmp_path / "task", **SHORT, horizon=400))
    faults = []
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {crowd})
    try:
        for wait in ("end = time.process_time() + 0.03", "time.sleep(0.03); end = 0"):
            source = (
                "import time\ndef policy(obs):\n"
                f"    {wait}\n"
                "    while time.process_time() < end: pass\n"
                "    return 0.0, 0.0\n"
            )
            work = tmp_path / f"work-{len(faults)}"
            write_workdir(work, task)
            judge = Judge(task, source.encode(), work, at_a_time=1, wall_seconds=5.0)
            rollout = judge.rollout()
            judge.close()
            assert rollout.outcome == "error"
            faults.append(judge.fault)
    finally:
        os.sched_setaffinity(0, before)
    assert faults[1] is None
    assert "waited" in faults[0]


class Steps:
    """An environment that answers at once."""

    def step(self, action):
        return None


@pytest.mark.slow
def test_in_its_own_loop_too_only_its_own_time_counts(crowded):
    """60 % of a second in short calls are within a second, however long it waits."""
    child = crowded(LOOP)
    before = child.waited()
    began = time.monotonic()
    assert child.run_episode(Steps(), 20, timeout=1.0) is None
    assert child.waited() - before > 0.05
    assert time.monotonic() - began > 0.6


@pytest.mark.slow
def test_in_its_own_loop_too_much_work_is_too_much(crowded):
    """Two seconds of work in short calls are more than one."""
    with pytest.raises(ControllerTimeout, match="run_episode"):
        crowded(LOOP).run_episode(Steps(), 70, timeout=1.0)
