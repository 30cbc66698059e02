"""Static and contract tests of a controller, before it drives on a task set."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

from pydantic import ConfigDict

from tdac_agent.storage.plain import plain
from tdac_agent.storage.printable_record import PrintableRecord
from tdac_agent.verification.diagnosis.report import MAX_MESSAGE, Report
from tdac_agent.verification.judge.time_limit import CPU, time_limit
from tdac_agent.verification.suite.contract import (
    ParseError,
    import_error,
    parse_source,
    policy_error,
)
from tdac_agent.verification.suite.hygiene import HYGIENE, hygiene_error

CHECKS_FILE = "checks.json"
CHECKED_STEPS = 10
"""Steps on a world of `dev` in which the controller must fulfil the contract."""
SECONDS = 60.0
"""CPU time of the static tests together; most take milliseconds."""
PARSES, STABLE = "test_source_parses", f"test_short_rollout_is_stable[{CHECKED_STEPS}]"
"""Tests have the names that they have in `suite/every_task.py`."""
STATIC, CONTRACT = "test_static.py", "test_end_to_end.py"
"""Files that have these tests in the suite of a task."""


class Checks(PrintableRecord):
    """The tests that ran, by name: why each failed, or None."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    results: dict[str, str | None]

    @property
    def failures(self) -> tuple[str, ...]:
        """A line for each failed test."""
        failed = self.results.items()
        return tuple(f"{name}: {why}" for name, why in failed if why is not None)

    @property
    def outcomes(self) -> dict[str, str]:
        """`passed` or `failed` for each test."""
        results = self.results.items()
        return {name: "passed" if why is None else "failed" for name, why in results}


def checks_of(report: Report) -> Checks:
    """Why each test of a report failed, or None; with what happened in its episode."""
    found: dict[str, str | None] = {_name_of(test): None for test in report.tests}
    for failure in report.failures:
        text, diagnosis = failure.message, failure.diagnosis
        if diagnosis is not None:
            quoted = plain(text) in diagnosis.text
            text = diagnosis.text if quoted else f"{text}; {diagnosis.text}"
        found[_name_of(failure.test)] = text
    return Checks(results=found)


def _name_of(test: str) -> str:
    """The name of a test in reports on episodes: that of an own one with its file."""
    file, _, name = test.partition("::")
    return name if file in (STATIC, CONTRACT) else test


def id_of(name: str) -> str:
    """The name of a test, as in the reports of suites."""
    return f"{CONTRACT if name == STABLE else STATIC}::{name}"


def static_checks(source: bytes) -> dict[str, str | None]:
    """Runs the static tests of a suite, for the profile `policy`.

    Args:
        source: Bytes of the controller.

    Returns:
        Why each test failed, or None. A source that does not parse fails the first
        test, and the others do not run.
    """
    try:
        tree = parse_source(source)
    except ParseError as error:
        return {PARSES: str(error)}
    tests: dict[str, Callable[[], str | None]] = {
        # On a set there is no `sensors`; whoever imports it fails the next test.
        "test_imports": partial(import_error, tree, {"sensors"}),
        "test_policy_is_defined": partial(policy_error, tree),
    }
    tests |= {
        f"test_hygiene[{pattern}]": partial(hygiene_error, tree, pattern)
        for pattern in HYGIENE
    }
    results: dict[str, str | None] = {PARSES: None}
    deadline = time.process_time() + SECONDS
    return results | {name: _failure_of(test, deadline) for name, test in tests.items()}


def _failure_of(test: Callable[[], str | None], deadline: float) -> str | None:
    """Why a test fails; None if it passes."""
    try:
        reason = f"the static tests took longer than {SECONDS:g} s"
        with time_limit(deadline, reason, CPU):
            error = test()
    except Exception as fault:  # of a deeply nested source, for example
        error = f"{type(fault).__name__}: {fault}"
    return None if error is None else error[:MAX_MESSAGE]
