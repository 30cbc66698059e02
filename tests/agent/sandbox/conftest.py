"""Children for tests, and the check that none of them leaves anything behind."""

import functools
import os
import time
from pathlib import Path

import pytest

from tdac_agent.sandbox import TIERS, Limits, SandboxError, start

PATIENT = Limits(import_seconds=30, reset_seconds=30, call_seconds=30)


@functools.cache
def why_not(tier):
    """Return why a tier does not work here, or an empty text."""
    try:
        start(tier=tier).close()
    except SandboxError as error:
        return str(error)
    return ""


def processes():
    """Return (pid, session, environment) of all running processes."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
            environment = (folder / "environ").read_bytes()
        except OSError:
            continue
        if fields[0] not in "ZX":
            found.append((int(folder.name), int(fields[3]), environment))
    return found


def left_running(pid, root):
    return [
        p
        for p, session, environment in processes()
        if session == pid or os.fsencode(root) in environment
    ]


@pytest.fixture
def wait_until_gone():
    """Return what still runs of a child after at most some seconds."""

    def wait(pid, root, seconds=5.0):
        deadline = time.monotonic() + seconds
        while (left := left_running(pid, root)) and time.monotonic() < deadline:
            os.sched_yield()
        return left

    return wait


@pytest.fixture(params=[tier.name for tier in TIERS])
def tier(request):
    """Every tier that works here, one after the other."""
    if reason := why_not(request.param):
        pytest.skip(reason)
    return request.param


@pytest.fixture
def promising_tier(tier):
    """Every working tier that promises to hide files and to deny the network."""
    if tier == "rlimits":
        pytest.skip("rlimits alone promises nothing")
    return tier


@pytest.fixture
def workdir(tmp_path):
    folder = tmp_path / "given"
    folder.mkdir()
    (folder / "params.json").write_text("{}")
    (folder / "sensors.py").write_text("RANGE = 220\n")
    return folder


@pytest.fixture
def launch(workdir, tmp_path, monkeypatch, wait_until_gone):
    """Start children on a source; at the end each must be gone without a trace."""
    base = tmp_path / "tmp"
    base.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(base))
    children = []

    def launch(source, tier="auto", limits=PATIENT):
        child = start(workdir, source, tier=tier, limits=limits)
        children.append(child)
        return child

    yield launch
    for child in children:
        child.close()
    for child in children:
        assert wait_until_gone(child.pid, base) == []
    assert list(base.iterdir()) == []


@pytest.fixture
def loaded(launch):
    """Start children that have imported their source."""

    def loaded(source, tier="auto", limits=PATIENT):
        child = launch(source, tier, limits)
        child.load()
        return child

    return loaded
