"""The fixtures that suites are written with; a public contract, see docs/suites.md."""

from __future__ import annotations

import ast
import functools
import os
from collections.abc import Callable
from importlib.util import decode_source
from pathlib import Path
from typing import Any

import pytest
from _pytest.runner import runtestprotocol

from tdac_agent.contract import MAX_SOURCE_BYTES
from tdac_agent.judge import Judge, rollout_key
from tdac_agent.oracle import Oracle
from tdac_agent.report import GROUPS, MAX_MESSAGE, group_of, id_of
from tdac_agent.sandbox import ControllerError
from tdac_agent.task import Task
from tdac_agent.trajectory import Rollout

# Some of these cost a verification more than its tests do.
UNUSED_PLUGINS = (
    "cacheprovider",
    "unraisableexception",
    "threadexception",
    "doctest",
    "pastebin",
    "stepwise",
    "faulthandler",
    "legacypath",
)


class Controller:
    """The controller under test; its code runs in the sandbox, never here.

    Attributes:
        source: The file's text.
    """

    def __init__(self, judge: Judge) -> None:
        self._judge = judge
        self.source = judge.source.decode("utf-8", "replace")

    @functools.cached_property
    def tree(self) -> ast.Module:
        """Syntax tree of the source; a source that does not parse fails the test."""
        size = len(self._judge.source)
        if size > MAX_SOURCE_BYTES:
            limit = f"at most {MAX_SOURCE_BYTES} are allowed"
            pytest.fail(f"the source has {size} bytes, {limit}", pytrace=False)
        try:
            # As Python itself reads a file, which may declare an encoding.
            return ast.parse(decode_source(self._judge.source))
        except SyntaxError as error:
            line = f" (line {error.lineno})" if error.lineno else ""
            reason = f"{error.msg}{line}"
        except (ValueError, RecursionError, MemoryError) as error:
            reason = str(error) or type(error).__name__
        pytest.fail(f"the source does not parse: {reason}", pytrace=False)

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
        the controller's own loop step an environment that the judge holds;
        `drive="truncated run_episode"` ends that loop by `truncated`.
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

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Leaves out the tests of other profiles, and fixes what must run.

        What another hook leaves out afterwards is missing, and so has failed.
        """
        chosen = [i for i in items if not self._left_out & _marker_names(i)]
        # What costs little and explains most comes first.
        items[:] = sorted(chosen, key=lambda i: GROUPS.index(group_of(id_of(i.nodeid))))
        self.expected = [id_of(item.nodeid) for item in items]

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_makereport(self, call: pytest.CallInfo[None]) -> None:
        """Cuts what an error says, before a report takes it apart line by line.

        A message may quote megabytes that a controller returned.
        """
        error = None if call.excinfo is None else call.excinfo.value
        while error is not None:
            _shorten(error)
            error = error.__cause__ or error.__context__

    def pytest_runtest_protocol(
        self, item: pytest.Item, nextitem: pytest.Item | None
    ) -> bool:
        """Runs a test; one in which a call took too long is run once more."""
        item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
        reports = runtestprotocol(item, log=False, nextitem=nextitem)
        if self._judge.call_timed_out():
            item._initrequest()  # type: ignore[attr-defined]
            reports = runtestprotocol(item, log=False, nextitem=nextitem)
        for report in reports:
            item.ihook.pytest_runtest_logreport(report=report)
        item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
        return True


def _shorten(error: BaseException) -> None:
    text = str(error)
    if len(text) > MAX_MESSAGE:
        error.args = (f"{text[:MAX_MESSAGE]} …",)
        if isinstance(error, pytest.fail.Exception):
            error.msg = error.args[0]


def _marker_names(item: pytest.Item) -> set[str]:
    return {marker.name for marker in item.iter_markers()}


def run_tests(suites: list[Path], log: Path, *plugins: object) -> None:
    """Runs pytest over folders that lie side by side, hermetic, with a report log."""
    root = suites[0].parent
    arguments = [
        *(str(folder) for folder in suites),
        f"--rootdir={root}",
        f"--confcutdir={root}",
        "-c",
        os.devnull,
        "-p",
        "pytest_reportlog.plugin",
        f"--report-log={log}",
        *(word for name in UNUSED_PLUGINS for word in ("-p", f"no:{name}")),
        "--import-mode=importlib",
        "--assert=plain",
        "--strict-markers",
        "-q",
    ]
    pytest.main(arguments, plugins=plugins)
