"""The fixtures for suites; a public contract, see docs/suites.md."""

from __future__ import annotations

import ast
import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tdac_agent.episodes.trajectory import Rollout
from tdac_agent.sandbox import ControllerError
from tdac_agent.verification.judge.judge import Judge, rollout_key
from tdac_agent.verification.judge.suite_episode import SuiteTask
from tdac_agent.verification.suite.contract import ParseError, parse_source
from tdac_agent.verification.suite.oracle import Oracle

JUDGE: pytest.StashKey[Judge] = pytest.StashKey()
"""Key of the judge in pytest's configuration."""


class Controller:
    """The controller under test; its code runs in the sandbox, never in this process.

    Attributes:
        source: The file's text.
    """

    def __init__(self, judge: Judge) -> None:
        self._judge = judge
        self.source = judge.source.decode("utf-8", "replace")

    @functools.cached_property
    def tree(self) -> ast.Module:
        """Syntax tree of the source; a source that does not parse fails the test."""
        try:
            return parse_source(self._judge.source)
        except ParseError as error:
            pytest.fail(str(error), pytrace=False)

    def constant(self, name: str) -> Any:
        """Value of a top-level name."""
        return self._judge.unit().get(name)

    def call(self, name: str, *args: Any, **kwargs: Any) -> Any:
        """Calls a top-level function or class.

        Exact Python types are kept. A result that is not plain data becomes a `Remote`
        with `call(method, ...)`, which can be an argument of further calls.
        """
        return self._judge.unit().call(name, *args, **kwargs)

    def error_of(self, name: str, *args: Any, **kwargs: Any) -> ControllerError | None:
        """The error that a call raises, or None if it returns."""
        try:
            self.call(name, *args, **kwargs)
        except ControllerError as error:
            return error
        return None


@pytest.fixture(scope="session")
def task(pytestconfig: pytest.Config) -> SuiteTask:
    """The task: `params`, `nominal`, `spec`, `progress_steps`.

    On a task set, that of its first public world.
    """
    return pytestconfig.stash[JUDGE].task


@pytest.fixture(scope="session")
def controller(pytestconfig: pytest.Config) -> Controller:
    """The controller under test."""
    return Controller(pytestconfig.stash[JUDGE])


@pytest.fixture(scope="session")
def oracle(task: SuiteTask) -> Oracle:
    """Exact answers to questions about planning and the task's environment."""
    return task.environment.oracle()


@pytest.fixture(scope="session")
def generator(pytestconfig: pytest.Config) -> Callable[[str], np.random.Generator]:
    """`generator(name)`: a random generator seeded by the run's seed and the name.

    It draws cases that a controller cannot have memorised.
    """
    seed = pytestconfig.stash[JUDGE].seed
    return lambda name: np.random.default_rng([seed, *name.encode()])


@pytest.fixture
def rollout(
    pytestconfig: pytest.Config, record_property: Callable[[str, object], None]
) -> Callable[..., Rollout]:
    """`rollout(name, steps=None, drive="policy")`: a judged episode, run once.

    Names are `nominal` and `jitter 1` … `jitter 5`. With `drive="run_episode"` the
    controller's own loop steps the judge's environment; with
    `drive="truncated run_episode"` the environment truncates that loop.
    """
    judge = pytestconfig.stash[JUDGE]

    def run(
        name: str = "nominal", *, steps: int | None = None, drive: str = "policy"
    ) -> Rollout:
        record_property("rollout", rollout_key(name, steps, drive))
        return judge.rollout(name, steps=steps, drive=drive)

    return run
