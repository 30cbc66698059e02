"""What the judge's process left behind, as an outcome of each expected test."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from tdac_agent.errors import Fault
from tdac_agent.judging import Findings
from tdac_agent.report import Diagnosis, Failure, Verdict, group_of
from tdac_agent.suite_plugin import MAX_MESSAGE, test_id


def read_findings(results: Path, output: str) -> Findings:
    """The judge's findings.

    Args:
        results: Folder the judge wrote to.
        output: What it printed.

    Raises:
        Fault: There are none, or they say that the sandbox failed.
    """
    path = results / "findings.json"
    try:
        findings = Findings.model_validate_json(path.read_text(encoding="utf-8"))
    except (OSError, ValidationError) as error:
        raise Fault(f"the judge left no findings: {_tail(output)}") from error
    if findings.fault is not None:
        raise Fault(findings.fault)
    if not findings.expected:
        raise Fault(f"the suite could not be collected: {_tail(output)}")
    return findings


def read_outcomes(
    path: Path, findings: Findings
) -> tuple[dict[str, str], list[Failure]]:
    """Outcome of each expected test; what is missing from the log has failed.

    Raises:
        Fault: The suite cannot be collected, or ran what was not expected.
    """
    tests = dict.fromkeys(findings.expected, "missing")
    failures: dict[str, Failure] = {}
    for record in _lines(path):
        kind = record.get("$report_type")
        if kind == "CollectReport" and record["outcome"] != "passed":
            raise Fault(f"the suite is broken: {_collect_error(record)}")
        if kind != "TestReport":
            continue
        name = test_id(record["nodeid"])
        if name not in tests:
            raise Fault(f"the suite ran a test that was not expected: {name}")
        if record["outcome"] != "passed" or "wasxfail" in record:
            tests[name] = "failed" if record["outcome"] == "failed" else "skipped"
            failures.setdefault(name, _failure(name, record, findings))
        elif record["when"] == "call" and tests[name] == "missing":
            tests[name] = "passed"
    for name, outcome in tests.items():
        if outcome == "missing":
            message = "the test did not run to its end"
            failures[name] = Failure(test=name, group="judge", message=message)
    return tests, [failures[name] for name in tests if name in failures]


def verdict_of(tests: dict[str, str]) -> Verdict:
    """Passed if every expected test passed."""
    passed = sum(outcome == "passed" for outcome in tests.values())
    return Verdict(
        passed=passed == len(tests),
        expected=len(tests),
        passed_tests=passed,
        failed_tests=len(tests) - passed,
    )


def _lines(path: Path) -> Iterator[dict[str, Any]]:
    """The records of a report log; a torn line ends it."""
    if not path.exists():
        return
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        try:
            record = json.loads(line)
        except json.JSONDecodeError:
            return
        if not isinstance(record, dict):
            return
        yield record


def _failure(name: str, record: dict[str, Any], findings: Findings) -> Failure:
    diagnosis = None
    for key, value in record.get("user_properties", []):
        if key == "rollout" and value in findings.diagnoses:
            diagnosis = Diagnosis.model_validate_json(findings.diagnoses[value])
    message = _message(record)
    return Failure(
        test=name, group=group_of(name), message=message, diagnosis=diagnosis
    )


def _message(record: dict[str, Any]) -> str:
    """Why a test failed, without the assertion's source; printable and bounded."""
    details = record.get("longrepr")
    if isinstance(details, dict):
        text = str((details.get("reprcrash") or {}).get("message", ""))
    elif isinstance(details, list | tuple) and details:
        text = str(details[-1])  # of a skip: file, line, reason
    else:
        text = str(details)
    for prefix in ("AssertionError: ", "Failed: "):
        text = text.removeprefix(prefix)
    # Exceptions are shown with their module; the class says enough.
    head, separator, tail = text.partition(": ")
    if separator and head.startswith("tdac_agent."):
        text = tail
    shown = "".join(c if c.isprintable() or c == "\n" else "\ufffd" for c in text)
    return shown if len(shown) <= MAX_MESSAGE else f"{shown[:MAX_MESSAGE]} …"


def _collect_error(record: dict[str, Any]) -> str:
    """Why a test file cannot be imported: pytest's own last line about it."""
    text = _message(record)
    marked = [line[1:].strip() for line in text.splitlines() if line.startswith("E ")]
    return f"{test_id(record['nodeid'])}: {marked[-1] if marked else text}"


def _tail(output: str) -> str:
    kept = [line for line in output.strip().splitlines() if line.strip()][-6:]
    return " | ".join(kept) or "no output"
