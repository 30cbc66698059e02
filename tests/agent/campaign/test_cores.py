"""Locks of cores are this user's own, and what dies for want of them says so."""

import os
import stat

import pytest

from tdac_agent.errors import Fault
from tdac_agent.executors.cores import core_locks, own_core

NAME = f"tdac-cores-{os.geteuid()}"


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """A temporary folder that is empty, and no other place."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    return folder


def link(place, elsewhere):
    place.symlink_to(elsewhere)


def file(place, elsewhere):
    place.touch()


def of_another(place, elsewhere):
    if os.geteuid():
        pytest.skip("only root can give a folder away")
    place.mkdir()
    os.chown(place, 12345, 12345)


@pytest.mark.parametrize("make", [link, file, of_another])
def test_the_place_of_somebody_else_is_not_used(temporary, monkeypatch, make):
    """Nothing is made there; another place is taken, or one line says what to do."""
    elsewhere, own = temporary / "elsewhere", temporary / "own"
    for folder in (elsewhere, own):
        folder.mkdir()
    make(temporary / NAME, elsewhere)
    with pytest.raises(
        Fault, match=f"{NAME} is not a writable folder of your own"
    ) as caught:
        core_locks()
    assert "\n" not in str(caught.value)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(own))
    with own_core() as turn:
        assert turn.parent == own / "tdac-cores"
        assert list(turn.parent.iterdir())
    assert list(elsewhere.iterdir()) == []


def test_nobody_else_may_open_the_folder(temporary):
    """Not even where an earlier version has left it open."""
    (temporary / NAME).mkdir(mode=0o777)
    (temporary / NAME).chmod(0o777)
    assert core_locks() == temporary / NAME
    assert stat.S_IMODE((temporary / NAME).stat().st_mode) == 0o700


@pytest.mark.slow
def test_a_campaign_without_a_place_says_so_at_once(temporary, small):
    """In one line, instead of a death of each of its processes."""
    (temporary / NAME).symlink_to(temporary)
    small.write(learners=["builtin"])
    code, _, complained = small.run("--workers", 1)
    assert code == 3
    assert f"{temporary / NAME} is not a writable folder of your own" in complained
    assert "died" not in complained


@pytest.mark.slow
def test_a_death_carries_its_reason(temporary, small):
    """A worker that meets a link for a lock makes no file through it, and tells why."""
    core_locks()
    for core in os.sched_getaffinity(0):
        (temporary / NAME / f"{core}.taken").symlink_to(temporary / "made")
    small.write(learners=["builtin"], runs=1)
    code, said, _ = small.run("--workers", 1)
    assert code == 3
    assert not (temporary / "made").exists()
    error = "OSError: [Errno 40] Too many levels of symbolic links"
    assert f"its process died 3 times; last reason: {error}" in said
    assert f"/r0001 died: {error}" in said
