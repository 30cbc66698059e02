"""The fixtures that suites are written with; a public contract, see docs/suites.md."""

from __future__ import annotations

import ast
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tdac_agent.judge import Judge
from tdac_agent.oracle import Oracle
from tdac_agent.sandbox import ControllerError
from tdac_agent.task import Task
from tdac_agent.trajectory import Rollout


class Controller:
    """The controller under test; its code runs in the sandbox, never here.

    Attributes:
        source: The file's text.
    """

    def __init__(self, judge: Judge) -> None:
        self._judge = judge
        self.source = judge.source

    @property
    def tree(self) -> ast.Module:
        """Syntax tree of the source; a source that does not parse fails the test."""
        try:
            return ast.parse(self.source)
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            line = f" (line {error.lineno})" if isinstance(error, SyntaxError) else ""
            pytest.fail(f"the source does not parse: {error}{line}", pytrace=False)

    def constant(self, name: str) -> Any:
        """Value of a top-level name."""
        return self._judge.unit().get(name)

    def call(self, name: str, *args: Any, **kwargs: Any) -> Any:
        """Calls a top-level function or class.

        Exact Python types are kept. What cannot be sent as data comes back as a
        `Remote`, with `call(method, ...)`, and may be passed on as an argument.
        """
        return self._judge.unit().call(name, *args, **kwargs)

    def error_of(self, name: str, *args: Any, **kwargs: Any) -> ControllerError | None:
        """The error that a call raises, or None where it returns."""
        try:
            self.call(name, *args, **kwargs)
        except ControllerError as error:
            return error
        return None


class JudgePlugin:
    """Gives a suite its fixtures and notes what ran.

    Attributes:
        expected: Test ids of this profile, as collected before any of them ran.
    """

    def __init__(self, judge: Judge, *, profile: str, paper: bool) -> None:
        self._judge = judge
        self._left_out = set() if profile == "paper" else {"paper"}
        if paper:
            self._left_out.add("jitter")
        self.expected: list[str] = []

    @pytest.fixture(scope="session")
    def task(self) -> Task:
        """The task: `params`, `nominal`, `spec`, `progress_steps`."""
        return self._judge.task

    @pytest.fixture(scope="session")
    def controller(self) -> Controller:
        """The controller under test."""
        return Controller(self._judge)

    @pytest.fixture(scope="session")
    def oracle(self) -> Oracle:
        """Exact answers to planning questions."""
        return Oracle()

    @pytest.fixture
    def rollout(
        self, record_property: Callable[[str, object], None]
    ) -> Callable[..., Rollout]:
        """`rollout(name, steps=None, drive="policy")`: a judged episode, run once.

        Names are `nominal` and `jitter 1` … `jitter 5`; `drive="run_episode"` lets
        the controller's own loop step an environment that the judge holds.
        """

        def run(
            name: str = "nominal", *, steps: int | None = None, drive: str = "policy"
        ) -> Rollout:
            record_property("rollout", rollout_key(name, steps, drive))
            return self._judge.rollout(name, steps=steps, drive=drive)

        return run

    def pytest_configure(self, config: pytest.Config) -> None:
        """Declares the markers that choose tests by profile."""
        config.addinivalue_line("markers", "paper: only in the profile `paper`")
        config.addinivalue_line("markers", "jitter: not with `--paper`")

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Leaves out the tests of other profiles, and fixes what must run."""
        chosen = [i for i in items if not self._left_out & _marker_names(i)]
        items[:] = chosen
        self.expected = [test_id(item.nodeid) for item in chosen]


def rollout_key(name: str, steps: int | None, drive: str) -> str:
    """One episode's name in a report log."""
    return json.dumps([name, steps, drive])


def _marker_names(item: pytest.Item) -> set[str]:
    return {marker.name for marker in item.iter_markers()}


def test_id(nodeid: str) -> str:
    """A test's id without folders: `test_unit.py::test_plan_path`."""
    path, _, rest = nodeid.partition("::")
    return f"{Path(path).name}::{rest}"


test_id.__test__ = False  # type: ignore[attr-defined]


def lines(path: Path) -> Iterator[dict[str, Any]]:
    """The records of a report log; a torn last line ends it."""
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            yield json.loads(line)
        except json.JSONDecodeError:
            return
