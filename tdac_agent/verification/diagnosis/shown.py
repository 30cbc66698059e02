"""A report in the units that the user reads, which may be metres of a map's frame."""

from __future__ import annotations

import re

from tdac_agent.tasks.units import Units
from tdac_agent.verification.diagnosis.report import Failure, Report

_PIXELS = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?) px\b")
# Other tests compare with grids of their own, which have no scale.
_ON_THE_MAP = "end to end"


def in_units(report: Report, units: Units) -> Report:
    """A copy whose failures read in the user's units; it is not stored.

    Figures stay in the units of the environment (`Provenance.unit`).

    Args:
        report: The report of a verification.
        units: As from `Setting.shown`.
    """
    if units.shown is None:
        return report
    failures = tuple(_failure(failure, units) for failure in report.failures)
    return report.model_copy(update={"failures": failures})


def _failure(failure: Failure, units: Units) -> Failure:
    changes: dict[str, object] = {}
    if failure.group == _ON_THE_MAP:
        changes["message"] = _PIXELS.sub(
            lambda found: units.far(float(found[1])), failure.message
        )
    diagnosis = failure.diagnosis
    if diagnosis is not None and diagnosis.shown is not None:
        text = {"text": diagnosis.shown}
        changes["diagnosis"] = diagnosis.model_copy(update=text)
    return failure.model_copy(update=changes)
