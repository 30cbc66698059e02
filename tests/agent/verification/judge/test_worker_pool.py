"""Processes that work side by side."""

import multiprocessing
import os
import signal
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from functools import partial

import pytest

from tdac_agent.errors import Fault
from tdac_agent.sandbox import ControllerTimeout
from tdac_agent.verification.judge.worker_pool import WorkerPool


def no_end():
    """Nothing is left to do."""


def test_work_is_done_elsewhere():
    """Arguments go out and results come back; this process is not touched."""
    seen = []

    def work(number, *, factor):
        seen.append(number)
        return os.getpid(), number * factor, len(seen)

    with closing(WorkerPool(work, no_end, 1)) as worker_pool:
        first, second = worker_pool.do(3, factor=7), worker_pool.do(4, factor=7)
    assert first[0] == second[0] != os.getpid()
    assert first[1:] == (21, 1)
    assert second[1:] == (28, 2)
    assert seen == []


def test_a_member_gets_ready_by_itself():
    """What comes first is done once, in the member, before its first work."""
    seen = []
    work = partial(list, seen)

    def get_ready():
        seen.append(os.getpid())

    with closing(WorkerPool(work, no_end, 1, first=get_ready)) as worker_pool:
        assert worker_pool.do() == worker_pool.do() == worker_pool.members
    assert seen == []


def test_members_work_at_the_same_time():
    """Each waits for the other one, which only both at once can do."""
    (read_a, write_a), (read_b, write_b) = os.pipe(), os.pipe()

    def work(mine, other):
        os.write(mine, b"x")
        os.read(other, 1)
        return os.getpid()

    with (
        closing(WorkerPool(work, no_end, 2)) as worker_pool,
        ThreadPoolExecutor(2) as pool,
    ):
        ends = [(write_a, read_b), (write_b, read_a)]
        members = list(pool.map(lambda pair: worker_pool.do(*pair), ends))
    assert len(set(members)) == 2
    for descriptor in (read_a, write_a, read_b, write_b):
        os.close(descriptor)


def test_members_at_work_have_a_core_each():
    """They stay on it while they work; one more than there are cores goes anywhere."""
    cores = os.sched_getaffinity(0)
    size = len(cores) + 1
    barrier = multiprocessing.get_context("fork").Barrier(size)

    def work():
        barrier.wait(60)
        mine = os.sched_getaffinity(0)
        barrier.wait(60)
        return mine

    with (
        closing(WorkerPool(work, no_end, size)) as worker_pool,
        ThreadPoolExecutor(size) as pool,
    ):
        for _ in range(2):
            found = sorted(pool.map(lambda _: worker_pool.do(), range(size)), key=len)
            assert [len(mine) for mine in found] == [1] * len(cores) + [len(cores)]
            assert set().union(*found[: len(cores)]) == cores


def test_errors_come_back_whole():
    """What the work raises is raised here, with all it knows."""

    def work():
        raise ControllerTimeout("policy", 3.0)

    with closing(WorkerPool(work, no_end, 1)) as worker_pool:
        with pytest.raises(ControllerTimeout, match="policy did not end") as caught:
            worker_pool.do()
        assert caught.value.phase == "policy"
        assert caught.value.seconds == 3.0
        with pytest.raises(ControllerTimeout):
            worker_pool.do()


def test_a_dead_member_is_a_fault():
    """Neither pass nor fail, and nobody waits for it for ever."""

    def work():
        os.kill(os.getpid(), signal.SIGKILL)

    with closing(WorkerPool(work, no_end, 1)) as worker_pool:
        for _ in range(2):
            with pytest.raises(Fault, match="process of the judge"):
                worker_pool.do()


def test_the_end(tmp_path):
    """Every member does what it was given as its end, and is gone afterwards."""

    def end():
        (tmp_path / str(os.getpid())).touch()

    worker_pool = WorkerPool(os.getpid, end, 3)
    members = worker_pool.members
    worker_pool.close()
    assert {int(path.name) for path in tmp_path.iterdir()} == set(members)
    for pid in members:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_members_write_to_nothing_that_is_not_theirs():
    """While they are at work, what this process shares with others is as it was.

    It has dropped what its members share among themselves, whose memory must not be
    used again as long as they write there.
    """
    context = multiprocessing.get_context("fork")
    begun, may_end = context.Barrier(3), context.Event()

    def work():
        begun.wait(60)
        return may_end.wait(60)

    with (
        closing(WorkerPool(work, no_end, 2)) as worker_pool,
        ThreadPoolExecutor(2) as pool,
    ):
        values = [context.RawValue("i", 0) for _ in range(8)]
        at_work = [pool.submit(worker_pool.do) for _ in range(2)]
        begun.wait(60)
        found = [value.value for value in values]
        may_end.set()
        assert [task.result() for task in at_work] == [True, True]
    assert found == [0] * 8
