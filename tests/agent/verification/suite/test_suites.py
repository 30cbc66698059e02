"""The integrity of verdicts: only the expected tests, each passed, count."""

import os

import pytest
from small import QUICK, write_small_task

from tdac_agent import load_task
from tdac_agent.environments.map2d.builtin import MapParameters, template_for
from tdac_agent.errors import ControllerFileError, Fault
from tdac_agent.tasks.task import write_workdir
from tdac_agent.verification.diagnosis.report import Report
from tdac_agent.verification.judge.judge import Judge
from tdac_agent.verification.verify import verify


@pytest.fixture
def check(small_task, good_source, tmp_path, warm):
    """Verifies the good controller with a suite of one more file."""

    def check(text, conftest=None, **options) -> Report:
        folder = tmp_path / "mine"
        folder.mkdir(exist_ok=True)
        (folder / "test_mine.py").write_text(text)
        if conftest is not None:
            (folder / "conftest.py").write_text(conftest)
        given = {"profile": "policy", "paper": True, "judge": warm, **options}
        return verify(good_source, small_task, suite=folder, **given)

    return check


def outcome(report, test="test_it"):
    return report.tests[f"own/test_mine.py::{test}"]


STRICT = """
def pytest_configure(config):
    config.addinivalue_line("filterwarnings", "error")
"""


def test_the_fixtures_warn_of_nothing(check):
    """A suite may take pytest's warnings for errors."""
    text = "def test_it(task, controller, oracle, rollout):\n    rollout()\n"
    report = check(text, STRICT)
    assert report.failures == ()
    assert outcome(report) == "passed"


@pytest.mark.slow
def test_a_users_test_takes_part(check):
    """It gets the documented fixtures, is expected, and is named as the user's."""
    text = '''
def test_it(controller, task, rollout, oracle):
    """Every fixture of the contract."""
    assert "def policy" in controller.source
    assert controller.constant("N_RAYS") == task.params.robot.n_rays
    assert controller.error_of("nearest_free") is not None
    assert controller.call("_octile", (0, 0), (3, 0)) == 3
    episode = rollout("nominal")
    assert episode.reached and not episode.collisions
    assert oracle.grid(1).shape == (30, 40)


def test_fails(rollout):
    assert rollout("nominal").trajectory.steps == 0, "the episode has steps"
'''
    report = check(text)
    assert outcome(report) == "passed"
    assert not report.passed
    (failure,) = report.failures
    assert failure.test == "own/test_mine.py::test_fails"
    assert failure.group == "user"
    assert failure.message == "the episode has steps"
    assert report.provenance.suite == "map2d + mine"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("body", "found"),
    [
        ("pytest.skip('no')", "skipped"),
        ("pytest.xfail('no')", "skipped"),
        ("pytest.importorskip('nosuchmodule')", "skipped"),
        ("assert False, 'no'", "failed"),
        ("raise SystemExit(0)", "failed"),
        ("pytest.exit('enough', 0)", "missing"),
    ],
)
def test_anything_but_passed_is_a_failure(check, body, found):
    """A skip, an xfail or an exit is not a pass, however the rest went."""
    report = check(f"import pytest\n\ndef test_it():\n    {body}\n")
    assert not report.passed
    assert outcome(report) == found
    assert report.failures[-1].test == "own/test_mine.py::test_it"
    assert report.failures[-1].message


def test_an_unexpected_pass_is_no_pass(check):
    """A test that is marked to fail and passes is not counted as passed."""
    text = "import pytest\n\n@pytest.mark.xfail\ndef test_it():\n    assert True\n"
    assert not check(text).passed


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("import nosuchmodule\n\ndef test_it(): ...\n", "No module named 'nosuchmodul"),
        ("def test_it(:\n", "SyntaxError"),
        ("import os\n\ndef test_it():\n    os._exit(0)\n", "left no findings"),
        ("import pytest\n@pytest.mark.nosuch\ndef test_it(): ...\n", "nosuch"),
    ],
)
def test_a_broken_suite_is_a_fault(check, text, reason):
    """It says nothing about the controller: neither pass nor fail."""
    with pytest.raises(Fault, match=reason) as caught:
        check(text)
    assert "/tmp" not in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_conftest_of_the_suite_may_be_used(check):
    """Fixtures beside the user's tests are found."""
    conftest = "import pytest\n\n@pytest.fixture\ndef three():\n    return 3\n"
    report = check("def test_it(three):\n    assert three == 3\n", conftest)
    assert report.passed


def test_a_conftest_cannot_take_tests_away(check):
    """Tests that a hook leaves out are missing, and so have failed."""
    hook = "def pytest_collection_modifyitems(items):\n    items[:] = items[-1:]\n"
    report = check("def test_it():\n    pass\n", hook)
    assert not report.passed
    assert report.tests["test_end_to_end.py::test_reaches_goal"] == "missing"


def test_no_suite_in_the_folder(small_task, good_source, tmp_path):
    """A folder that is missing, or has no test files, is the user's error."""
    with pytest.raises(ControllerFileError, match=r"it has no test_\*\.py"):
        verify(good_source, small_task, suite=tmp_path)
    with pytest.raises(ControllerFileError, match="no such folder"):
        verify(good_source, small_task, suite=tmp_path / "none")


def test_markers_choose_the_tests(check):
    """`paper` and `jitter` leave a test out of the verdicts it is not meant for."""
    text = """
import pytest

@pytest.mark.paper
def test_paper(): ...

@pytest.mark.jitter
def test_jitter(): ...

def test_it(): ...
"""
    names = {
        name.partition("::")[2] for name in check(text).tests if name.startswith("own/")
    }
    assert names == {"test_it"}


@pytest.mark.slow
def test_the_tasks_own_suite_is_found_beside_its_file(tmp_path, good_source):
    """`suite` in task.yaml is relative to that file, and is part of the verdict."""
    folder = write_small_task(tmp_path / "task", suite="mine")
    (folder / "mine").mkdir()
    (folder / "mine" / "test_mine.py").write_text("def test_it():\n    assert 0, 'a'\n")
    task = load_task(folder, trust=True)
    report = verify(good_source, task, profile="policy", paper=True)
    assert outcome(report) == "failed"


PLUGIN = """
import pytest

@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item, call):
    result = yield
    result.get_result().outcome = "passed"
"""


@pytest.mark.slow
def test_the_users_pytest_does_not_change_a_verdict(
    small_task, tmp_path, monkeypatch, check
):
    """Configuration, plugins and variables for the user's own tests have no effect."""
    monkeypatch.chdir(tmp_path)
    for name in ("conftest.py", "helpful.py"):
        (tmp_path / name).write_text(PLUGIN)
    options = "-p helpful --collect-only -k nothing --co"
    (tmp_path / "pytest.ini").write_text(f"[pytest]\naddopts = {options}\n")
    (tmp_path / "sitecustomize.py").write_text("")
    monkeypatch.setenv("PYTEST_ADDOPTS", options)
    monkeypatch.setenv("PYTEST_PLUGINS", "helpful")
    monkeypatch.setenv("PYTHONOPTIMIZE", "2")
    monkeypatch.setenv("PYTHONWARNINGS", "error")
    report = check("def test_it():\n    assert False, 'no'\n", judge=None)
    assert [failure.message for failure in report.failures] == ["no"]
    assert outcome(report) == "failed"
    nothing = "def policy(obs):\n    return 0.0, 0.0\n"
    assert not verify(nothing, small_task, profile="policy", paper=True).passed


@pytest.mark.slow
@pytest.mark.parametrize(
    ("body", "tests_run"), [("time.sleep(99)", "xyy"), ("while True: pass", "xy")]
)
def test_a_call_that_is_kept_waiting_is_tried_once_more(tmp_path, body, tests_run):
    """The test runs again, unless the call had a CPU all the time that it may take."""
    text = """
import time
from pathlib import Path

COUNT = Path(__file__).with_name("count")


def test_it(controller):
    COUNT.open("a").write("x")
    controller.call("nearest_free", "not a map", 0, 0, 1)


def test_slow(controller):
    COUNT.open("a").write("y")
    controller.call("hang")


def test_after(controller):
    assert controller.call("_octile", (0, 0), (3, 0)) == 3
"""
    hang = f"\n\nimport time\n\n\ndef hang():\n    {body}\n"
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "test_mine.py").write_text(text)
    task = load_task(write_small_task(tmp_path / "task"))
    source = template_for(task.params.robot, 0.05).render(MapParameters()) + hang
    # A host may have kept the CPU from what computes, which is rightly tried again.
    for _ in range(4 if "while" in body else 1):
        (folder / "count").unlink(missing_ok=True)
        report = verify(
            source, task, profile="policy", paper=True, suite=folder, limits=QUICK
        )
        if (folder / "count").read_text() == tests_run:
            break
    assert (folder / "count").read_text() == tests_run
    assert outcome(report, "test_after") == "passed"
    messages = {f.test.rpartition("::")[2]: f.message for f in report.failures}
    assert messages["test_slow"] == "hang did not end within 1.5 s"
    assert "AttributeError at nearest_free" in messages["test_it"]


@pytest.mark.slow
def test_an_episode_that_is_kept_waiting_is_run_again(small_task, tmp_path, quick):
    """Its time-out counts only if it comes a second time."""
    write_workdir(tmp_path, small_task)
    source = b"import time\n\n\ndef policy(obs):\n    time.sleep(9)\n"
    judge = Judge(small_task, source, tmp_path, limits=quick)
    began = os.times().elapsed
    rollout = judge.rollout("nominal")
    judge.close()
    assert rollout.timed_out
    assert rollout.error == "policy did not end within 1.5 s"
    assert os.times().elapsed - began >= 3.0


@pytest.mark.slow
@pytest.mark.parametrize(
    "source",
    [b"while True:\n    pass\n", b"def policy(obs):\n    while True:\n        pass\n"],
)
def test_a_loop_without_end_is_waited_for_once(small_task, tmp_path, quick, source):
    """It had a CPU all the time, and would need it all again."""
    write_workdir(tmp_path, small_task)
    # A host may have kept the CPU from it, and it is rightly tried again.
    for _ in range(4):
        judge = Judge(small_task, source, tmp_path, limits=quick)
        rollout = judge.rollout("nominal")
        judge.close()
        assert rollout.timed_out
        if not rollout.is_retryable and judge.cpu_seconds < 2.5:
            break
    assert not rollout.is_retryable
    assert 1.0 < judge.cpu_seconds < 2.5


@pytest.mark.slow
def test_provenance_names_what_was_tested(small_task, check):
    """Another controller or suite gives another hash, the rest stays as it was."""

    def hashes(report):
        about = report.provenance.model_dump()
        return {key: about[key] for key in about if key.endswith("_sha256")}

    own = "def test_it():\n    assert False\n"
    first = hashes(check(own))
    other = hashes(check(own + "# more\n"))
    assert {key for key in first if first[key] != other[key]} == {"suite_sha256"}
    other = hashes(verify("x = 1\n", small_task, profile="policy", paper=True))
    changed = {key for key in first if first[key] != other[key]}
    assert changed == {"suite_sha256", "controller_sha256"}


@pytest.mark.parametrize(
    "changes",
    [
        {"goal": [131, 30]},
        {"start": [30, 30, 0.5]},
        {"horizon": 401},
        {"progress": {"fraction": 0.5}},
        {"tolerance": 12.0},
        {"robot": {"radius": 6, "n_rays": 17}},
        {"dt": 0.04},
    ],
)
def test_the_tasks_hash_covers_it(small_task, tmp_path, changes):
    """Whatever decides an episode changes the hash; a name does not."""
    assert load_task(write_small_task(tmp_path, **changes)).sha256() != (
        small_task.sha256()
    )
    same = load_task(write_small_task(tmp_path, name="other"))
    assert same.sha256() == small_task.sha256()


POOR = """
import os
import resource


def test_it(controller):
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (3, limits[1]))
    try:
        controller.constant("N_RAYS")
    {forgiving}
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)
"""
NO_FILES = """
import os

os.rename("work", "gone")


def test_it(controller):
    controller.constant("N_RAYS")
"""
OTHER_FILES = """
from pathlib import Path


def test_it(rollout):
    rollout()
    Path("work/params.json").write_text("{}")
"""
BROKEN_HOOK = "def pytest_runtest_logreport():\n    raise KeyError('a hook')\n"


@pytest.mark.slow_after(1)
@pytest.mark.parametrize(
    ("text", "conftest", "reason"),
    [
        (POOR.format(forgiving=""), None, "Too many open files"),
        (POOR.format(forgiving="except OSError: pass"), None, "Too many open files"),
        (NO_FILES, None, "cannot copy the working folder"),
        (OTHER_FILES, None, "changed the task's files"),
        ("def test_it(): ...\n", BROKEN_HOOK, "KeyError: 'a hook'"),
    ],
    ids=["no descriptors", "forgiven", "no files", "other files", "a hook"],
)
def test_what_goes_wrong_in_the_judge_is_no_verdict(check, text, conftest, reason):
    """Whatever test it happens in, and whether or not that test forgives it."""
    with pytest.raises(Fault, match=reason) as caught:
        check(text, conftest)
    assert "\n" not in str(caught.value)
