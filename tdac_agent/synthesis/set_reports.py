"""Reports on worlds of a task set: feedback and figures."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean

from tdac_agent.prompting.feedback import Feedback, cut
from tdac_agent.synthesis.candidates import Figures
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.judge.episode_row import EpisodeRow

RANKED = {"time": "mean time score"}
WORST = 4
"""The worst n-th of the worlds stands for robustness."""
REFUSED = "refused"
"""What failed if a file fails the static and contract tests."""


def set_feedback(report: EpisodeReport) -> Feedback:
    """Categories of failure with their counts, and diagnoses of up to three episodes.

    Args:
        report: A report with a failure, on worlds of `dev`.
    """
    line = summary_of(report)
    if not report.count:
        lines = [f"- {cut(text)}" for text in report.told]
        text = "\n".join([f"{line[0].upper()}{line[1:]}:", *lines])
        return Feedback(text, f"{line}: {cut(report.told[0], 200)}", (REFUSED,))
    assert report.scores is not None
    parts = [
        f"On {report.count} worlds that were new to it: {line}. Mean score "
        f"{report.scores.time:.3f} (success weighted by time)."
    ]
    parts += [f"{n}. {cut(text)}" for n, text in enumerate(report.told, 1)]
    return Feedback("\n\n".join(parts), line, tuple(report.causes))


def summary_of(report: EpisodeReport) -> str:
    """The result in one line, such as `5 of 8 worlds reached; 2 stuck, 1 collision`."""
    if not report.count:
        return "the static and contract tests refused the file, so it did not drive"
    causes = ", ".join(f"{count} {name}" for name, count in report.causes.items())
    reached = f"the goal reached in {report.successes} of {report.count} worlds"
    return f"{reached}; {causes}" if causes else reached


def figures_of(episodes: Sequence[EpisodeRow]) -> Figures:
    """Mean time and path scores, success, and time score on the worst worlds."""
    times = sorted(each.time_score for each in episodes)
    figures = {
        "time": fmean(times),
        "path": fmean(each.path_score for each in episodes),
        "success": fmean(each.success for each in episodes),
        "worst": fmean(times[: max(1, len(times) // WORST)]),
    }
    return Figures(figures, RANKED)
