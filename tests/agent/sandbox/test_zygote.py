"""Children of one zygote share no more than children of two."""

import os
import signal

import pytest

from tdac_agent.nursery import Nursery
from tdac_agent.sandbox import (
    ControllerError,
    Limits,
    SandboxError,
    find_tier,
    fork_child,
    start_zygote,
)

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
        children[-1].furnish(None, WRITER)
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


def test_a_nursery_has_more_children_than_a_zygote_has_places(tier):
    nursery = Nursery(ahead=False)
    children = [nursery.take(tier, Limits()) for _ in range(14)]
    assert len({child.folder.root for child in children}) == 14
    for child in children:
        child.close()
    nursery.close()
    assert not any(child.folder.root.parent.exists() for child in children)


def test_a_nursery_that_was_not_used_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    Nursery().close()
    assert list(tmp_path.iterdir()) == []
