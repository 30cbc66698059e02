"""Reports as JUnit XML files, for the pages of a continuous integration."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from tdac_agent.errors import ControllerFileError
from tdac_agent.storage.files import write_atomic
from tdac_agent.verification.verdict import confirmed_text, is_verified

if TYPE_CHECKING:
    from tdac_agent.verification.diagnosis.gap import Gap
    from tdac_agent.verification.diagnosis.report import Report
    from tdac_agent.verification.episode_report import EpisodeReport


def write_junit(
    report: Report, path: Path, confirmation: EpisodeReport | None = None
) -> None:
    """Writes a JUnit XML file: a case per expected test, and one for blind drives."""
    messages = {failure.test: failure.message for failure in report.failures}
    cases = {name: messages.get(name) for name in report.tests}
    if confirmation is not None:
        told = None if is_verified(confirmation) else confirmed_text(confirmation)
        cases["confirmation::blind drives"] = told
    title, gap = f"tdac {report.provenance.task}", report.smallest_gap
    _write_cases(
        title, cases, report.seconds, path, gap, report.provenance.unit,
        len(report.too_close),
    )  # fmt: skip


def write_set_junit(report: EpisodeReport, path: Path) -> None:
    """Writes a JUnit XML file with a test case per test and per public world."""
    split = report.provenance.split
    cases = {
        name if "::" in name else f"static::{name}": _reason(name, report.told)
        if result == "failed"
        else None
        for name, result in report.tests.items()
    }
    for each in report.episodes:
        reason = each.text or each.cause or each.outcome
        cases[f"{split}::world {each.index}"] = None if each.success else reason
    if report.sequential is not None:
        decision = report.sequential.decision
        cases[f"{split}::decision"] = None if decision == "accepted" else decision
    title, gap = f"tdac {report.provenance.name}", report.smallest_gap
    _write_cases(
        title, cases, report.seconds, path, gap, report.provenance.unit,
        report.too_close,
    )  # fmt: skip


def _reason(test: str, told: tuple[str, ...]) -> str:
    """Why a test failed, from the lines about all that did."""
    head = f"{test}: "
    lines = (line.removeprefix(head) for line in told if line.startswith(head))
    return next(lines, "failed")


def _write_cases(
    title: str,
    cases: dict[str, str | None],
    seconds: float,
    path: Path,
    gap: Gap | None,
    unit: str,
    too_close: int,
) -> None:
    """Writes a JUnit XML file; a failed case has a message.

    The smallest gap and the number of episodes that came too close are properties.
    """
    suite = ElementTree.Element(
        "testsuite",
        name=title,
        tests=str(len(cases)),
        failures=str(sum(message is not None for message in cases.values())),
        time=str(seconds),
    )
    if gap is not None:
        told = {
            f"smallest_gap_{unit}": gap.gap,
            f"required_gap_{unit}": gap.required,
            "too_close": too_close,
        }
        listed = ElementTree.SubElement(suite, "properties")
        for name, value in told.items():
            ElementTree.SubElement(listed, "property", name=name, value=str(value))
    for name, message in cases.items():
        file, _, test = name.partition("::")
        case = ElementTree.SubElement(suite, "testcase", classname=file, name=test)
        if message is not None:
            ElementTree.SubElement(case, "failure", message=message)
    try:
        write_atomic(path, ElementTree.tostring(suite, encoding="utf-8"))
    except OSError as error:
        raise ControllerFileError(f"cannot write {path}: {error.strerror}") from error
