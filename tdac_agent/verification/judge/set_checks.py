"""Static and contract tests of a controller, before it drives on a task set."""

from __future__ import annotations

import ast
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import pytest
from pydantic import ConfigDict

from tdac_agent.storage.printable_record import PrintableRecord
from tdac_agent.verification.diagnosis.report import MAX_MESSAGE
from tdac_agent.verification.judge.time_limit import time_limit
from tdac_agent.verification.suite import every_task
from tdac_agent.verification.suite.contract import ParseError, parse_source
from tdac_agent.verification.suite.hygiene import HYGIENE

CHECKS_FILE = "checks.json"
CHECKED_STEPS = 10
"""Steps on a world of `dev` in which the controller must fulfil the contract."""
SECONDS = 60.0
"""Limit of the static tests together; most take milliseconds."""
PARSES = every_task.test_source_parses.__name__
STABLE = f"{every_task.test_short_rollout_is_stable.__name__}[{CHECKED_STEPS}]"


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


@dataclass(frozen=True, slots=True)
class _Parsed:
    """What the static tests of the suites ask of a controller."""

    tree: ast.Module


def static_checks(source: bytes) -> dict[str, str | None]:
    """Runs the static tests of a suite, for the profile `policy`.

    Args:
        source: Bytes of the controller.

    Returns:
        Why each test failed, or None. A source that does not parse fails the first
        test, and the others do not run.
    """
    try:
        controller = _Parsed(parse_source(source))
    except ParseError as error:
        return {PARSES: str(error)}
    tests: dict[str, Callable[[], object]] = {
        test.__name__: partial(test, controller)
        for test in (every_task.test_imports, every_task.test_policy_is_defined)
    }
    name = every_task.test_hygiene.__name__
    tests |= {
        f"{name}[{pattern}]": partial(every_task.test_hygiene, controller, pattern)
        for pattern in HYGIENE
    }
    results: dict[str, str | None] = {PARSES: None}
    deadline = time.monotonic() + SECONDS
    return results | {name: _failure_of(test, deadline) for name, test in tests.items()}


def _failure_of(test: Callable[[], object], deadline: float) -> str | None:
    """Why a test fails, as in the report of a suite; None if it passes."""
    too_long = f"the static tests took longer than {SECONDS:g} s"
    try:
        with time_limit(deadline, too_long):
            test()
    except AssertionError as error:
        return str(error)[:MAX_MESSAGE]
    except (Exception, pytest.fail.Exception) as error:
        # Of a deeply nested source, for example.
        return f"{type(error).__name__}: {error}"[:MAX_MESSAGE]
    return None
