"""What the models are told about a candidate that failed on a task set."""

from __future__ import annotations

from tdac_agent.evaluation.set_report import SetReport
from tdac_agent.prompting.feedback import Feedback, cut

REFUSED = "refused"
"""What failed if a file fails the static and contract tests."""


def set_feedback(report: SetReport) -> Feedback:
    """Categories of failure with their counts, and diagnoses of up to three episodes.

    Args:
        report: A report with a failure, on worlds of `dev`.
    """
    line = summary_of(report)
    if not report.worlds:
        lines = [f"- {cut(text)}" for text in report.told]
        text = "\n".join([f"{line[0].upper()}{line[1:]}:", *lines])
        return Feedback(text, f"{line}: {cut(report.told[0], 200)}", (REFUSED,))
    assert report.scores is not None
    parts = [
        f"On {report.worlds} worlds that were new to it: {line}. Mean score "
        f"{report.scores.time:.3f} (success weighted by time)."
    ]
    parts += [f"{n}. {cut(text)}" for n, text in enumerate(report.told, 1)]
    return Feedback("\n\n".join(parts), line, tuple(report.causes))


def summary_of(report: SetReport) -> str:
    """The result in one line, such as `5 of 8 worlds reached; 2 stuck, 1 collision`."""
    if not report.worlds:
        return "the static and contract tests refused the file, so it did not drive"
    causes = ", ".join(f"{count} {name}" for name, count in report.causes.items())
    reached = f"the goal reached in {report.successes} of {report.worlds} worlds"
    return f"{reached}; {causes}" if causes else reached
