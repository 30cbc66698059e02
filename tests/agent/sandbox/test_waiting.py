"""A machine that is busy with other work makes no verdict."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tdac_agent.sandbox import ControllerTimeout, Limits

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/schedstat").exists(), reason="the kernel does not tell"
)
OTHERS = 3
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
def crowded(launch):
    """Starts children on a CPU for which others compete all the time."""
    cpu = min(os.sched_getaffinity(0))
    command = [sys.executable, "-c", "print(flush=True)\nwhile True: pass"]
    others = [subprocess.Popen(command, stdout=subprocess.PIPE) for _ in range(OTHERS)]
    for other in others:
        other.stdout.readline()  # it is at work
        os.sched_setaffinity(other.pid, {cpu})

    def start(source):
        child = launch(source, limits=LIMITS)
        child.load()
        os.sched_setaffinity(child.pid, {cpu})
        return child

    yield start
    for other in others:
        other.kill()
        other.communicate()


def test_standing_in_line_for_a_cpu_is_not_the_controllers_time(crowded):
    """0.6 s of work are within a second, however long they take by the clock."""
    child = crowded(BUSY)
    before = child.waited()
    assert child.policy(0.6) == (0.0, 0.0)
    assert child.waited() - before > 0.2


def test_on_a_busy_machine_too_much_work_is_too_much(crowded):
    """Two seconds of work are more than one."""
    with pytest.raises(ControllerTimeout, match="policy"):
        crowded(BUSY).policy(2.0)


def test_on_a_busy_machine_sleeping_is_the_controllers_time(crowded):
    """A controller that waits is not in line."""
    with pytest.raises(ControllerTimeout, match="policy"):
        crowded(IDLE).policy(30.0)
