"""Children of one zygote share no more than children of two."""

import os
import signal
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tdac_agent.sandbox import (
    ControllerError,
    Limits,
    SandboxError,
    find_tier,
    fork_child,
    start_zygote,
)
from tdac_agent.sandbox.zygote import SLOTS
from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.worker_pool import WorkerPool

WRITER = """
import os
KEPT = []
def write(text):
    KEPT.append(text)
    os.environ["KEPT"] = text
    with open(os.path.join(os.environ["TMPDIR"], "kept"), "w") as file:
        file.write(text)
    return os.getcwd()
def look(folder):
    own = os.path.join(os.environ["TMPDIR"], "kept")
    return KEPT, os.environ.get("KEPT"), os.path.exists(own)
def names(folder):
    return os.listdir(folder)
def read(path):
    with open(path) as file:
        return file.read()
def burn(seconds):
    import time
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass
def leave(code):
    os._exit(code)
def state():
    import random
    import numpy as np
    return random.random(), np.random.random()
"""


@pytest.fixture
def family(tier):
    """A zygote of several children, and a way to have one that is loaded."""
    zygote = start_zygote(find_tier(tier), Limits())
    children = []

    def child():
        if not zygote.slots:
            pytest.skip("here each child has a zygote of its own")
        children.append(fork_child(zygote, find_tier(tier), Limits()))
        children[-1].copy_files(None, WRITER)
        children[-1].load()
        return children[-1]

    yield child
    for each in children:
        each.close()
    zygote.close()
    assert not zygote.parent.exists()


def test_what_a_child_keeps_is_not_there_for_its_sibling(family):
    first = family()
    folder = first.call("write", ("a secret",))
    second = family()
    assert second.call("look", (folder,)) == ([], None, False)


def test_a_sibling_cannot_read_or_list_the_folders_beside_its_own(family):
    first = family()
    folder = first.call("write", ("a secret",))
    second = family()
    assert first.call("read", (f"{folder}/controller.py",)) == WRITER
    for path in (folder, os.path.dirname(folder), os.path.dirname(folder) + "/.."):
        with pytest.raises(ControllerError):
            second.call("names", (path,))
    for name in ("work/controller.py", "scratch/kept", "../witness"):
        with pytest.raises(ControllerError):
            second.call("read", (f"{os.path.dirname(folder)}/{name}",))


def test_a_child_that_ends_leaves_its_sibling_alone(family):
    first, second = family(), family()
    with pytest.raises(Exception, match="exit code 7"):
        first.call("leave", (7,))
    assert second.call("look", ("",)) == ([], None, False)
    os.kill(second.pid, signal.SIGKILL)
    third = family()
    assert third.call("look", ("",)) == ([], None, False)


def test_siblings_draw_different_random_numbers(family):
    first, second = family().call("state"), family().call("state")
    assert first[0] != second[0]
    assert first[1] != second[1]


@pytest.mark.slow_after(1)
def test_each_child_accounts_for_its_own_cpu_time(family):
    busy, idle = family(), family()
    busy.call("burn", (0.5,))
    used, other = busy.close().cpu_seconds, idle.close().cpu_seconds
    assert used >= 0.4
    assert other < used


def test_a_zygote_that_was_killed_is_a_fault_of_the_sandbox():
    zygote = start_zygote(find_tier("rlimits"), Limits())
    os.killpg(zygote._process.pid, signal.SIGKILL)
    with pytest.raises(SandboxError, match="rlimits: "):
        fork_child(zygote, find_tier("rlimits"), Limits())
    zygote.close()


@pytest.mark.slow_after(1)
def test_a_nursery_has_more_children_than_a_zygote_has_places(tier):
    child_pool = ChildPool(ahead=False)
    children = [child_pool.take(tier, Limits()) for _ in range(SLOTS + 2)]
    assert len({child.folder.root for child in children}) == SLOTS + 2
    for child in children:
        child.close()
    child_pool.close()
    assert not any(child.folder.root.parent.exists() for child in children)


def test_nothing_of_a_child_is_left_when_it_ends(tier, tmp_path):
    """Its files go at once, whatever other children its zygote may still have."""
    (tmp_path / "map").write_text("walls")
    child_pool = ChildPool(ahead=False)
    first, second = (child_pool.take(tier, Limits()) for _ in range(2))
    for child in (first, second):
        child.copy_files(tmp_path, WRITER)
        child.load()
        child.call("write", ("text",))
    first.close()
    left = first.folder.root.rglob("*")
    assert [path for path in left if not path.is_dir()] == []
    assert (second.folder.work / "map").read_text() == "walls"
    second.close()
    child_pool.close()


def test_a_nursery_that_was_not_used_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    ChildPool().close()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_processes_share_a_nursery(tier):
    """No two of them get the same child, be it ready or not; each ends its own."""
    child_pool = ChildPool(ahead=False)
    if tier == find_tier("auto").name:
        assert child_pool.prepare()
        assert child_pool.prepare()

    def use(number):
        with child_pool.take(tier, Limits()) as child:
            child.copy_files(None, f"NUMBER = {number}")
            child.load()
            return child.get("NUMBER"), str(child.folder.root)

    worker_pool = WorkerPool(use, child_pool.close, 2)
    with ThreadPoolExecutor(2) as pool:
        results = list(pool.map(worker_pool.do, range(SLOTS + 4)))
    worker_pool.close()
    assert [number for number, _ in results] == list(range(SLOTS + 4))
    assert len({root for _, root in results}) == SLOTS + 4
    child_pool.close()
    assert not any(Path(root).parent.exists() for _, root in results)


def test_children_that_were_ready_and_not_wanted_end():
    """Closing ends them; usual limits alone are what they are ready for."""
    child_pool = ChildPool(ahead=False)
    assert child_pool.prepare()
    child = child_pool.take("auto", Limits(memory_bytes=2 << 30))
    child.close()
    unwanted = child_pool._ready[0]
    child_pool.close()
    with pytest.raises(SandboxError):
        unwanted.load()


def test_a_child_stays_where_its_taker_is(tier):
    """It may use the cores that the process which takes it may use."""
    every = os.sched_getaffinity(0)
    child_pool = ChildPool(ahead=False)
    try:
        os.sched_setaffinity(0, {min(every)})
        bound = child_pool.take(tier, Limits())
    finally:
        os.sched_setaffinity(0, every)
    free = child_pool.take(tier, Limits())
    assert os.sched_getaffinity(bound.controller_pid) == {min(every)}
    assert os.sched_getaffinity(free.controller_pid) == every
    for child in (bound, free):
        child.close()
    child_pool.close()
