"""A log is read or refused; however it is torn, it never makes a pass of its own."""

import json

import pytest
from damage import altered_json, shuffled, torn
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from script import STILL

from tdac_agent.environments.map2d.entry import MAP2D
from tdac_agent.errors import Fault
from tdac_agent.sandbox import Limits
from tdac_agent.storage.files import write_atomic
from tdac_agent.tasks.task import portable_task_file, write_workdir
from tdac_agent.verification.judge.jobs import Findings, Job
from tdac_agent.verification.judge.report_log import (
    NOT_RUN,
    TORN,
    read_findings,
    read_outcomes,
    verdict_of,
)

FEW = settings(
    deadline=None,
    max_examples=200,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
MANY = settings(FEW, max_examples=10_000)
# Every kind of record that pytest writes of a test.
ODD_SUITE = '''
import warnings

import pytest


@pytest.fixture
def leaky():
    yield
    raise ValueError("teardown")


def first(task):
    return task.params["robot"]


def test_of_an_error(task):
    assert first(task)["radius"] > 0


def test_skips():
    pytest.skip("no reason")


@pytest.mark.xfail
def test_expected_to_fail():
    assert False


def test_teardown(leaky):
    warnings.warn("a warning")


def test_half_a_character(controller):
    """The message quotes what the controller calls itself."""
    raise AssertionError("it is " + controller.constant("NAME"))
'''


def judged(warm, task, folder, source, suite=None):
    """The files that the judge left of a real verification."""
    folder.mkdir()
    suites = {"shipped": MAP2D.suite} | ({"own": suite} if suite else {})
    job = Job(
        task=folder / "work",
        controller=folder / "controller.py",
        suites=[folder / "suites" / name for name in suites],
        profile="policy",
        paper=True,
        tier="auto",
        seed=0,
        limits=Limits(),
        out=folder / "results",
        trajectories=None,
    )
    job.out.mkdir()
    write_workdir(job.task, task)
    write_atomic(job.task / "task.yaml", portable_task_file(task))
    write_atomic(job.controller, source)
    (folder / "suites").mkdir()
    for name, path in suites.items():
        (folder / "suites" / name).symlink_to(path, target_is_directory=True)
    write_atomic(folder / "job.json", job.model_dump_json())
    warm.run(folder / "job.json", 120)
    return job.out


@pytest.fixture(scope="module")
def results(small_task, good_source, warm, tmp_path_factory):
    """Folders of results by name: one that passes, one that fails, a strange one."""
    base = tmp_path_factory.mktemp("results")
    suite = base / "suite"
    suite.mkdir()
    (suite / "test_odd.py").write_text(ODD_SUITE)
    odd = good_source + 'NAME = "\\ud800\\x1b[31m"\n'
    return {
        "good": judged(warm, small_task, base / "good", good_source),
        "bad": judged(warm, small_task, base / "bad", STILL),
        "odd": judged(warm, small_task, base / "odd", odd, suite),
    }


def outcomes(folder):
    return read_outcomes(folder / "report.jsonl", read_findings(folder, ""))


def test_whole_results_are_read(results):
    """What a verification left is its verdict: passed, or failed with each reason."""
    tests, failures = outcomes(results["good"])
    assert verdict_of(tests).passed
    assert failures == []
    tests, failures = outcomes(results["bad"])
    assert not verdict_of(tests).passed
    names = {f.test.partition("::")[2] for f in failures}
    assert names == {"test_progress", "test_reaches_goal"}
    assert all(f.diagnosis is not None for f in failures)
    tests, failures = outcomes(results["odd"])
    told = {f.test.removeprefix("own/test_odd.py::"): f.message for f in failures}
    assert told.pop("test_of_an_error").startswith("own/test_odd.py:14: TypeError: ")
    assert told == {
        "test_skips": "Skipped: no reason",
        "test_expected_to_fail": "line 27: an assertion without a message",
        "test_teardown": "own/test_odd.py:10: ValueError: teardown",
        "test_half_a_character": "it is \ufffd\ufffd[31m",
    }


def log_of(results, name):
    return (results[name] / "report.jsonl").read_bytes()


def proven(raw, expected):
    """Whether a log says, by itself, that each test passed and nothing else happened.

    Written without the reader's own means: undamaged lines to the last one, which says
    that pytest is content; of each test three passed phases, and no other word.
    """
    try:
        records = [json.loads(line.decode()) for line in raw.strip(b"\n").split(b"\n")]
    except (ValueError, RecursionError):
        return False
    if not all(isinstance(record, dict) for record in records):
        return False
    if records[-1] != {"exitstatus": 0, "$report_type": "SessionFinish"}:
        return False
    told = [
        (r["nodeid"].removeprefix("shipped/"), r["when"], r["outcome"])
        for r in records
        if r.get("$report_type") == "TestReport"
    ]
    phases = ("setup", "call", "teardown")
    wanted = {(test, when, "passed") for test in expected for when in phases}
    return set(told) == wanted


@st.composite
def damaged_logs(draw, logs):
    """A log after up to four accidents, and whether it was once a passing one."""
    name = draw(st.sampled_from(sorted(logs)))
    other = draw(st.sampled_from(sorted(logs)))
    raw, once_good = logs[name], name == "good"
    for _ in range(draw(st.integers(1, 4))):
        if draw(st.booleans()):
            raw = draw(torn(raw))
        else:
            lines = raw.split(b"\n")
            others = logs[other].split(b"\n")
            once_good |= other == "good"
            raw = b"\n".join(draw(shuffled(lines, others)))
    return raw, once_good


def check_log(results, folder, data):
    logs = {name: log_of(results, name) for name in results}
    raw, once_good = data.draw(damaged_logs(logs))
    path = folder / "damaged.jsonl"
    path.write_bytes(raw)
    findings = read_findings(results[data.draw(st.sampled_from(sorted(results)))], "")
    try:
        tests, failures = read_outcomes(path, findings)
    except Fault:
        return
    assert list(tests) == findings.expected
    failed = [name for name, outcome in tests.items() if outcome != "passed"]
    assert [failure.test for failure in failures] == failed
    if verdict_of(tests).passed:
        assert once_good
        assert proven(raw, findings.expected)


def test_a_log_that_was_cut(results, tmp_path):
    """Wherever a passing log ends too soon, it has not passed."""
    raw, path = log_of(results, "good"), tmp_path / "report.jsonl"
    findings = read_findings(results["good"], "")
    last = len(raw) - len(raw.strip().split(b"\n")[-1]) - 2
    for end in [*range(0, last, 997), *range(last, len(raw) - 1)]:
        path.write_bytes(raw[:end])
        tests, _ = read_outcomes(path, findings)
        assert not verdict_of(tests).passed, end
    path.write_bytes(raw[:-1])
    assert verdict_of(read_outcomes(path, findings)[0]).passed


def check_findings(results, folder, data):
    name = data.draw(st.sampled_from(sorted(results)))
    whole = (results[name] / "findings.json").read_bytes()
    expected = json.loads(whole)["expected"]
    raw = data.draw(altered_json(whole) if data.draw(st.booleans()) else torn(whole))
    (folder / "findings.json").write_bytes(raw)
    try:
        findings = read_findings(folder, "the end")
        tests, failures = read_outcomes(results[name] / "report.jsonl", findings)
    except Fault:
        return
    assert {f.test for f in failures} == {t for t in tests if tests[t] != "passed"}
    if verdict_of(tests).passed:
        assert name == "good"
        assert sorted(tests) == sorted(expected)


@pytest.mark.slow
@pytest.mark.parametrize("check", [check_log, check_findings])
@MANY
@given(st.data())
def test_damaged_results(results, tmp_path_factory, check, data):
    """They are a fault or a verdict; a pass needs a proof that is still in them."""
    check(results, tmp_path_factory.getbasetemp(), data)


@pytest.mark.parametrize("content", [None, b"", b"\xff", b"[]", b"[" * 10**5, "folder"])
def test_no_findings_are_a_fault(tmp_path, content):
    """Missing, empty or something else: neither pass nor fail, with the last words."""
    path = tmp_path / "findings.json"
    if content == "folder":
        path.mkdir()
    elif content is not None:
        path.write_bytes(content)
    with pytest.raises(Fault, match=r"left no findings: a \| b"):
        read_findings(tmp_path, "a\n\nb\n")


def record(nodeid, **fields):
    """Lines of a test that passed, or of its one phase that is given."""
    phases = [fields.pop("when")] if "when" in fields else ["setup", "call", "teardown"]
    about = {"$report_type": "TestReport", "outcome": "passed", "nodeid": nodeid}
    return "\n".join(json.dumps(about | {"when": phase} | fields) for phase in phases)


def end(status):
    return json.dumps({"$report_type": "SessionFinish", "exitstatus": status})


A, B = record("t.py::a"), record("t.py::b")


def findings(*expected):
    return Findings(
        expected=list(expected),
        episodes=[],
        diagnoses={},
        tier="x",
        child_cpu_seconds=0,
        fault=None,
    )


@pytest.mark.parametrize(
    ("log", "why"),
    [
        ([A, B, end(0)], None),
        ([A, end(0)], NOT_RUN),
        ([], NOT_RUN),
        ([A, B[:-1], end(0)], NOT_RUN),
        ([A, B], TORN),
        ([A, B, end(0), B], TORN),
        ([A, B, end(1)], TORN),
        ([A, B, end(2)], TORN),
        ([A, B, end("0")], TORN),
        ([A, B, end(False)], TORN),
        ([A, "garbage", B, end(0)], TORN),
        ([A, "[]", B, end(0)], TORN),
        ([A, "", B, end(0)], TORN),
        ([A, "\0", B, end(0)], TORN),
        ([A, record("t.py::b", when="setup"), end(0)], NOT_RUN),
        ([A, record("t.py::b", when="call"), end(0)], NOT_RUN),
        ([A, record("t.py::b", when=["call"]), B, end(0)], TORN),
        ([A, B.replace('"passed"', "null"), B, end(0)], TORN),
        ([A, B, record("t.py::b", wasxfail=""), end(0)], ""),
        ([A, B, record("t.py::b", outcome="skipped", longrepr="boom"), end(0)], "boom"),
        ([A, record("t.py::b", outcome="failed", longrepr="boom"), B, end(1)], "boom"),
        ([A, B, record("t.py::b", when="teardown", outcome="failed"), end(1)], ""),
    ],
)
def test_a_torn_log_is_no_pass(tmp_path, log, why):
    """What is missing from the log, or not wholly in it, has not passed."""
    path = tmp_path / "report.jsonl"
    path.write_text("\n".join(log))
    tests, failures = read_outcomes(path, findings("t.py::a", "t.py::b"))
    assert verdict_of(tests).passed is (why is None)
    assert [f.message for f in failures][-1:] == ([] if why is None else [why])
    assert set(tests) == {"t.py::a", "t.py::b"}


def test_a_torn_log_still_tells_what_failed(tmp_path):
    """Failures of a damaged log keep their messages; only its passes are void."""
    failed = record("t.py::b", when="call", outcome="failed", longrepr="boom")
    path = tmp_path / "report.jsonl"
    path.write_text("\n".join([A, failed, "{"]))
    _, failures = read_outcomes(path, findings("t.py::a", "t.py::b"))
    assert [f.message for f in failures] == [TORN, "boom"]


def test_a_missing_log_is_no_pass(tmp_path):
    """Without a log every test is missing."""
    for path in (tmp_path / "none", tmp_path):
        tests, failures = read_outcomes(path, findings("t.py::a"))
        assert tests == {"t.py::a": "missing"}
        assert failures[0].message == NOT_RUN


def test_no_tests_are_no_pass():
    """A verdict about nothing is not passed."""
    assert not verdict_of({}).passed


def test_unexpected_tests_are_a_fault(tmp_path):
    """A log of other tests than the expected ones is no verdict."""
    path = tmp_path / "report.jsonl"
    path.write_text(record("t.py::other"))
    with pytest.raises(Fault, match=r"not expected: t\.py::other"):
        read_outcomes(path, findings("t.py::a"))
