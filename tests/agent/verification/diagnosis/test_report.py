"""A report that is damaged does not read back, least of all as a pass."""

import contextlib
import json

import pytest
from damage import altered_json, torn
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from script import STILL

from tdac_agent.verification.diagnosis.report import Report
from tdac_agent.verification.verify import verify


@pytest.fixture(scope="module")
def report(small_task, warm):
    """A report of a controller that failed."""
    return verify(STILL, small_task, profile="policy", paper=True, judge=warm)


@pytest.mark.slow
@settings(deadline=None, max_examples=100)
@given(st.data())
def test_a_damaged_report(report, data):
    """It is refused, or says as before that the controller failed."""
    raw = report.model_dump_json().encode()
    damaged = altered_json(raw) if data.draw(st.booleans()) else torn(raw)
    with contextlib.suppress(ValidationError):
        assert not Report.model_validate_json(data.draw(damaged)).passed


def with_changes(report, verdict=None, **changes):
    content = json.loads(report.model_dump_json()) | changes
    content["verdict"] |= verdict or {}
    return content


@pytest.mark.parametrize(
    "change",
    [
        lambda r: with_changes(r, {"passed": True}),
        lambda r: with_changes(r, {"passed": True, "failed_tests": 0}),
        lambda r: with_changes(r, {"expected": r.verdict.expected + 1}),
        lambda r: with_changes(r, failures=[]),
        lambda r: with_changes(r, tests=dict.fromkeys(r.tests, "passed")),
        lambda r: with_changes(r, tests={}, failures=[]),
        lambda r: with_changes(
            r,
            {"passed": True, "expected": 0, "passed_tests": 0, "failed_tests": 0},
            tests={},
            failures=[],
        ),
    ],
)
def test_a_verdict_must_follow_from_the_tests(report, change):
    """A report whose verdict, counts, tests and failures disagree is refused."""
    Report.model_validate(with_changes(report))
    with pytest.raises(ValidationError, match=r"expected|contradicts"):
        Report.model_validate(change(report))


def test_figures_are_finite(report):
    """A figure that JSON cannot hold is refused, not written as null."""
    content = with_changes(report)
    content["episodes"][0]["d_min"] = float("inf")
    with pytest.raises(ValidationError, match="finite number"):
        Report.model_validate(content)
