"""Runs a suite with pytest: selection and order of its tests, and plugins."""

from __future__ import annotations

import os
from collections.abc import Generator
from pathlib import Path

import pytest
import pytest_reportlog.plugin
from _pytest.runner import runtestprotocol

from tdac_agent.verification.diagnosis.report import (
    GROUPS,
    MAX_MESSAGE,
    group_of,
    id_of,
)
from tdac_agent.verification.judge import fixtures as suite_fixtures
from tdac_agent.verification.judge.judge import Judge
from tdac_envs.core.errors import hint

# Some of these take more time than the tests of a verification.
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
# Maximum depth of a traceback, which limits the time that pytest takes to format it.
MOST_CALLS = 50
FIXTURES = ("controller", "task", "rollout", "oracle", "generator")
"""The fixtures of suites; see `docs/suites.md`."""


class JudgePlugin:
    """Gives a suite its judge, and records which tests must run.

    Attributes:
        expected: Ids of the tests of this profile, collected before any of them runs.
    """

    def __init__(self, judge: Judge, *, profile: str, paper: bool) -> None:
        self._judge = judge
        self._left_out = set() if profile == "paper" else {"paper"}
        if paper:
            self._left_out.add("jitter")
        self.expected: list[str] = []

    def pytest_configure(self, config: pytest.Config) -> None:
        """Declares the markers that select tests by profile; adds the fixtures."""
        config.stash[suite_fixtures.JUDGE] = self._judge
        config.pluginmanager.register(suite_fixtures)
        config.addinivalue_line("markers", "paper: only in the profile `paper`")
        config.addinivalue_line("markers", "jitter: not with `--paper`")

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Leaves out tests of other profiles, and fixes which tests must run.

        A test that another hook removes later is missing, and so has failed.
        """
        chosen = [i for i in items if not self._left_out & _marker_names(i)]
        # Quick tests that explain much come first.
        items[:] = sorted(chosen, key=lambda i: GROUPS.index(group_of(id_of(i.nodeid))))
        self.expected = [id_of(item.nodeid) for item in items]

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_setup(self) -> Generator[None]:
        """Ends the setup of a test when the verification has taken too long."""
        with self._judge.time_limit():
            return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self) -> Generator[None]:
        """Ends a test, or the formatting of its message, in the same case."""
        with self._judge.time_limit():
            return (yield)

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> None:
        """Cuts errors to a bounded size, before pytest formats them line by line.

        A message may quote megabytes that a controller returned, and deeply nested
        source gives a traceback of many calls. A fixture that does not exist is a fault
        of the suite.
        """
        error = None if call.excinfo is None else call.excinfo.value
        if isinstance(error, pytest.FixtureLookupError):
            self._judge.fault = self._judge.fault or _unknown_fixture(item, error)
        known: set[int] = set()
        while error is not None and id(error) not in known:
            known.add(id(error))
            _shorten(error)
            error = error.__cause__ or error.__context__

    def pytest_runtest_protocol(
        self, item: pytest.Item, nextitem: pytest.Item | None
    ) -> bool:
        """Runs a test; repeats it if a call timed out, maybe on a busy machine."""
        item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
        reports = runtestprotocol(item, log=False, nextitem=nextitem)
        if self._judge.wait_before_retry():
            item._initrequest()  # type: ignore[attr-defined]
            reports = runtestprotocol(item, log=False, nextitem=nextitem)
        for report in reports:
            item.ihook.pytest_runtest_logreport(report=report)
        item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
        return True


def _unknown_fixture(item: pytest.Item, error: pytest.FixtureLookupError) -> str:
    """Names the test, the fixture that it asks for, and the nearest documented one."""
    file, line, name = item.location
    place = file if line is None else f"{file}:{line + 1}"
    known = [each for each in FIXTURES if each != error.argname]
    wrong = f"{name} needs the fixture {error.argname!r}, which does not exist"
    return f"the suite is broken: {place}: {wrong}{hint(str(error.argname), known)}"


def _shorten(error: BaseException) -> None:
    call = error.__traceback__
    for _ in range(MOST_CALLS):
        call = call and call.tb_next
    if call is not None:
        call.tb_next = None
    text = str(error)
    if len(text) > MAX_MESSAGE:
        error.args = (f"{text[:MAX_MESSAGE]} …",)
        if isinstance(error, pytest.fail.Exception):
            error.msg = error.args[0]


def _marker_names(item: pytest.Item) -> set[str]:
    return {marker.name for marker in item.iter_markers()}


def run_tests(suites: list[Path], log: Path, *plugins: object) -> None:
    """Runs pytest hermetically on sibling folders, with a report log."""
    root = suites[0].parent
    arguments = [
        *(str(folder) for folder in suites),
        f"--rootdir={root}",
        f"--confcutdir={root}",
        "-c",
        os.devnull,
        f"--report-log={log}",
        *(word for name in UNUSED_PLUGINS for word in ("-p", f"no:{name}")),
        "--import-mode=importlib",
        "--assert=plain",
        "--strict-markers",
        "-q",
    ]
    # For a plugin given by name, pytest would search all installed packages.
    pytest.main(arguments, plugins=[pytest_reportlog.plugin, *plugins])
