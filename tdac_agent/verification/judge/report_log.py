"""Reads the outcome of each expected test from the files of the judge's process."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal, NamedTuple

from pydantic import BaseModel, Field, StrictInt, ValidationError

from tdac_agent.errors import Fault
from tdac_agent.storage.printable_record import PrintableRecord
from tdac_agent.verification.diagnosis.report import (
    MAX_MESSAGE,
    OWN,
    Diagnosis,
    Failure,
    Verdict,
    group_of,
    id_of,
)
from tdac_agent.verification.judge.jobs import Findings

PHASES = frozenset({"setup", "call", "teardown"})
INTERNAL_ERROR = 3
"""pytest's exit status after an internal error."""
BREAKDOWN = "INTERNALERROR>"
"""Prefix of the lines that pytest prints about an internal error."""
EXPECTED = ("AssertionError", "Failed: ", "tdac_agent.", "line ")
"""How the messages of assertions, of `pytest.fail` and of our own errors begin."""
OWN_FOLDER = f"/suites/{OWN}/"
"""Part of each path in the user's suite, as a verification lays it out."""
NOT_RUN = "the test did not run to its end"
TORN = "the report log is damaged or incomplete, so no test in it counts as passed"


class _Crash(PrintableRecord):
    message: str
    lineno: int | None = None


class _Place(PrintableRecord):
    path: str
    lineno: int


class _Call(PrintableRecord):
    reprfileloc: _Place | None = None


class _Entry(PrintableRecord):
    data: _Call = _Call()


class _Traceback(PrintableRecord):
    reprentries: list[_Entry] = Field(default_factory=list)


class _Details(PrintableRecord):
    reprcrash: _Crash | None = None
    reprtraceback: _Traceback | None = None


class _Collected(PrintableRecord):
    """pytest's record of a file, with the fields that are used."""

    nodeid: str
    outcome: Literal["passed", "failed", "skipped"]
    longrepr: _Details | tuple[str, int | None, str] | str | None = None


class _Tested(_Collected):
    """pytest's record of one phase of one test."""

    when: Literal["setup", "call", "teardown"]
    wasxfail: Any = None
    user_properties: list[tuple[str, Any]] = Field(default_factory=list)

    @property
    def passed(self) -> bool:
        return self.outcome == "passed" and "wasxfail" not in self.model_fields_set


class _Finished(BaseModel):
    """pytest's last record."""

    exitstatus: StrictInt


class _Other(BaseModel):
    """Any other record, such as a warning."""

    kind: str = Field(alias="$report_type")


_KINDS: dict[str, type[BaseModel]] = {
    "CollectReport": _Collected,
    "TestReport": _Tested,
    "SessionFinish": _Finished,
}


class _Log(NamedTuple):
    """Records of a report log; None for a damaged line."""

    records: list[BaseModel | None]

    def is_whole(self, failed: bool) -> bool:
        """Whether the log is complete and its exit status allows `failed` tests."""
        last = self.records[-1] if self.records else None
        ended = isinstance(last, _Finished) and last.exitstatus in (0, int(failed))
        return ended and None not in self.records

    @property
    def broke_down(self) -> bool:
        """Whether pytest ended with an internal error, such as that of a hook."""
        last = self.records[-1] if self.records else None
        return isinstance(last, _Finished) and last.exitstatus == INTERNAL_ERROR


def read_findings(results: Path, output: str) -> Findings:
    """Reads the judge's findings.

    Args:
        results: Folder that the judge wrote to.
        output: Output of its process.

    Raises:
        Fault: There are none, or they report a fault.
    """
    try:
        raw = (results / "findings.json").read_bytes()  # raw read: our temporary folder
        findings = Findings.model_validate_json(raw)
        for text in findings.diagnoses.values():
            Diagnosis.model_validate_json(text)
    except (OSError, ValidationError) as error:
        raise Fault(f"the judge left no findings: {_tail(output)}") from error
    if findings.fault is not None:
        raise Fault(findings.fault)
    if not findings.expected:
        raise Fault(f"the suite could not be collected: {_tail(output)}")
    return findings


def read_outcomes(
    path: Path, findings: Findings, output: str = ""
) -> tuple[dict[str, str], list[Failure]]:
    """Reads the outcome of each expected test; one that is not in the log has failed.

    A test has passed if the log is complete and each phase of the test passed.

    Args:
        path: The log.
        findings: The judge's findings.
        output: Output of its process.

    Raises:
        Fault: The suite cannot be collected, ran an unexpected test, or has a hook
            that raised.
    """
    log = _read(path)
    if log.broke_down:
        raise Fault(f"the suite caused an error in pytest: {_breakdown(output)}")
    phases: dict[str, set[str]] = {name: set() for name in findings.expected}
    tests: dict[str, str] = dict.fromkeys(findings.expected, "missing")
    failures: dict[str, Failure] = {}
    for record in log.records:
        if not isinstance(record, _Collected):
            continue
        name = id_of(record.nodeid)
        if not isinstance(record, _Tested):
            if record.outcome != "passed":
                raise Fault(f"the suite is broken: {_collect_error(name, record)}")
        elif name not in tests:
            raise Fault(f"the suite ran a test that was not expected: {name}")
        elif record.passed:
            phases[name].add(record.when)
        elif name not in failures:
            tests[name] = "failed" if record.outcome == "failed" else "skipped"
            failures[name] = _failure(name, record, findings)
    whole = log.is_whole(failed=bool(failures))
    for name in tests.keys() - failures.keys():
        if phases[name] == PHASES and whole:
            tests[name] = "passed"
        else:
            message = TORN if phases[name] == PHASES else NOT_RUN
            failures[name] = Failure(test=name, group="judge", message=message)
    return tests, [failures[name] for name in tests if name in failures]


def verdict_of(tests: dict[str, str]) -> Verdict:
    """The verdict: passed if there are tests and each of them passed."""
    passed = sum(outcome == "passed" for outcome in tests.values())
    return Verdict(
        passed=0 < passed == len(tests),
        expected=len(tests),
        passed_tests=passed,
        failed_tests=len(tests) - passed,
    )


def _read(path: Path) -> _Log:
    """Reads a report log; one that cannot be read is empty."""
    try:
        lines = path.read_bytes().split(b"\n")  # raw read: our temporary folder
    except OSError:
        return _Log([])
    return _Log([_record(line) for line in lines[: -1 if not lines[-1] else None]])


def _record(line: bytes) -> BaseModel | None:
    """The record in one line; None if it is damaged."""
    try:
        value = json.loads(line.decode("utf-8"))
        kind = _Other.model_validate(value).kind
        return _KINDS.get(kind, _Other).model_validate(value)
    except (ValueError, RecursionError):  # ValidationError is a ValueError
        return None


def _failure(name: str, record: _Tested, findings: Findings) -> Failure:
    diagnosis = None
    for key, value in record.user_properties:
        if key == "rollout" and type(value) is str and value in findings.diagnoses:
            diagnosis = Diagnosis.model_validate_json(findings.diagnoses[value])
            shown = {"shown": findings.shown.get(value)}
            diagnosis = diagnosis.model_copy(update=shown)
    message = _message(record)
    return Failure(
        test=name, group=group_of(name), message=message, diagnosis=diagnosis
    )


def _message(record: _Collected) -> str:
    """Why a test failed, without the assertion's source; printable and bounded."""
    details = record.longrepr
    if isinstance(details, _Details):
        text = _of_crash(details.reprcrash) if details.reprcrash else ""
        if not text.startswith(EXPECTED):
            text = _own_line(details.reprtraceback) + text
    elif isinstance(details, tuple):
        text = details[-1]  # of a skip: file, line, reason
    else:
        text = details or ""
    for prefix in ("AssertionError: ", "Failed: "):
        text = text.removeprefix(prefix)
    # The type of our own exceptions is left out; their message is enough.
    head, separator, tail = text.partition(": ")
    if separator and head.startswith("tdac_agent."):
        text = tail
    return text if len(text) <= MAX_MESSAGE else f"{text[:MAX_MESSAGE]} …"


def _own_line(calls: _Traceback | None) -> str:
    """`own/FILE:LINE: `, the last line of the user's suite in a traceback; or nothing.

    An error that is no assertion may be one of the test, and its message alone does not
    say where.
    """
    places = (
        [] if calls is None else [each.data.reprfileloc for each in calls.reprentries]
    )
    for place in reversed(places):
        _, found, file = f"/{place.path if place else ''}".rpartition(OWN_FOLDER)
        if place is not None and found:
            return f"{OWN}/{file}:{place.lineno}: "
    return ""


def _of_crash(crash: _Crash) -> str:
    """The message of an error; for a bare assertion, its line."""
    if crash.message != "AssertionError" or crash.lineno is None:
        return crash.message
    return f"line {crash.lineno}: an assertion without a message"


def _collect_error(name: str, record: _Collected) -> str:
    """Why a test file cannot be imported: pytest's own last line about it."""
    text = _message(record)
    marked = [line[1:].strip() for line in text.splitlines() if line.startswith("E ")]
    return f"{name}: {marked[-1] if marked else text}"


def _breakdown(output: str) -> str:
    """The internal error: the last line that pytest marks as such."""
    marked = [line for line in output.splitlines() if line.startswith(BREAKDOWN)]
    return marked[-1].removeprefix(BREAKDOWN).strip() if marked else _tail(output)


def _tail(output: str) -> str:
    kept = [line for line in output.strip().splitlines() if line.strip()][-6:]
    return " | ".join(kept) or "no output"
