"""The user's own tests on a task set: they come before the first world."""

import json
from xml.etree import ElementTree

import pytest
from few_worlds import KNOWN, write_set

from tdac_agent.cli.junit import write_set_junit
from tdac_agent.errors import Fault
from tdac_agent.problems.task_set import SetProblem
from tdac_agent.verification.own_tests import kept_tests, run_own_tests
from tdac_agent.verification.verify_episodes import verify_episodes
from tdac_envs import load_set
from tdac_envs.core.errors import TaskError

STILL = "def policy(obs):\n    return 0.0, 0.0\n"
ALL_FIXTURES = """
import numpy as np
import pytest


def test_reaches(rollout, task, generator, oracle, controller):
    episode = rollout()
    assert episode.reached, f"ended: {episode.outcome}"
    steps = episode.trajectory.steps
    assert rollout("nominal", steps=3).trajectory.steps == 3 < steps
    assert steps < task.progress_steps == 400
    assert task.params.robot.radius == task.nominal.robot.radius
    assert task.params.map is task.spec.map is True
    assert np.allclose(episode.trajectory.poses[0], task.nominal.start)
    cells = task.nominal.terrain.grid.cells
    assert oracle.shortest_length(cells, (0, 0), (1, 1)) > 0
    assert generator("x").integers(10**9) == generator("x").integers(10**9)
    assert controller.error_of("policy", None) is not None


def test_params_have_no_start(task):
    with pytest.raises(AttributeError, match="task.nominal describes"):
        task.params.start


@pytest.mark.jitter
def test_of_jittered_starts(rollout):
    rollout("jitter 1")


@pytest.mark.paper
def test_of_the_paper(rollout):
    rollout(drive="run_episode")
"""
OWN = "own/test_mine.py::test_reaches"


@pytest.fixture(scope="module")
def few(tmp_path_factory):
    """A set of small worlds."""
    return load_set(write_set(tmp_path_factory.mktemp("few") / "few.yaml"))


@pytest.fixture(scope="module")
def suite(tmp_path_factory):
    """Tests that use each fixture."""
    return suite_of(tmp_path_factory.mktemp("mine"), ALL_FIXTURES)


def suite_of(folder, text):
    (folder / "test_mine.py").write_text(text)
    return folder


@pytest.mark.slow
def test_each_fixture_is_there(few, suite, warm, tmp_path):
    """They see the first public world; tests of jittered starts are left out."""
    source = KNOWN.read_bytes()
    report = run_own_tests(source, few, suite, out=tmp_path, judge=warm)
    assert report.passed, report.failures
    own = [name for name in report.tests if name.startswith("own/")]
    assert own == [OWN, "own/test_mine.py::test_params_have_no_start"]
    assert "test_static.py::test_imports" in report.tests
    assert report.provenance.suite_sha256 == SetProblem(few, suite).suite_sha256
    assert kept_tests(tmp_path, few, suite, source, None) == report
    other = suite_of(tmp_path / "trajectories", ALL_FIXTURES + "\n# other\n")
    assert kept_tests(tmp_path, few, other, source, None) is None


def test_who_fails_them_drives_on_no_world(few, suite, warm, tmp_path):
    """The report names the test and what happened; the set keeps its hash."""
    before = few.sha256
    report = verify_episodes(STILL, few, 3, suite=suite, out=tmp_path, judge=warm)
    assert (report.refused, report.passed, report.count) == (True, False, 0)
    assert report.tests[OWN] == "failed"
    assert report.tests["test_imports"] == "passed"
    (line,) = report.told
    assert line.startswith(f"{OWN}: ended: out of time; nominal: no motion: ")
    kept = json.loads((tmp_path / "report.json").read_text())
    assert kept["failures"][0]["diagnosis"]["cause"] == "no motion"
    assert report.provenance.sha256 == before
    write_set_junit(report, tmp_path / "junit.xml")
    failed = ElementTree.parse(tmp_path / "junit.xml").findall("testcase[failure]")
    assert [f"{each.get('classname')}::{each.get('name')}" for each in failed] == [OWN]


@pytest.mark.slow
def test_who_passes_them_drives(few, suite, warm, tmp_path):
    """The report on the worlds has the outcomes of all tests."""
    report = verify_episodes(KNOWN, few, 2, suite=suite, out=tmp_path, judge=warm)
    assert (report.count, report.tests[OWN]) == (2, "passed")
    kept = json.loads((tmp_path / "episodes.json").read_text())
    assert kept["tests"] == report.tests


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("words", ["'jitter 1'", "drive='run_episode'"])
def test_what_a_set_has_not_is_a_fault_of_the_suite(few, warm, tmp_path, words):
    """It says nothing about the controller; one line names it, and a way out."""
    text = f"def test_mine(rollout):\n    rollout({words})\n"
    with pytest.raises(Fault, match=r"does not suit a task set: .*jitter or") as found:
        run_own_tests(STILL, few, suite_of(tmp_path, text), judge=warm)
    assert "\n" not in str(found.value)


def test_a_seed_needs_tests_that_draw(few):
    """All else in an episode follows from its world; the message says what to use."""
    with pytest.raises(TaskError, match=r"--first M with -n N, choose worlds"):
        verify_episodes(STILL, few, 1, seed=3)
