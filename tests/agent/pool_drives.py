"""Candidates whose episodes in the pool of a race are made up."""

from pathlib import Path

from tdac_agent.synthesis.archive import Archive, Member
from tdac_agent.synthesis.candidates import Candidate, Figures
from tdac_agent.synthesis.set_reports import figures_of
from tdac_agent.verification.diagnosis.losses import Losses
from tdac_agent.verification.judge.episode_row import EpisodeRow

FIRST = 7_000_123
"""Number of the first episode; no model is told of it."""


def row_of(number, score, failed="", **changes):
    """An episode with a time score; a failure has a cause, and 0."""
    if failed:
        facts = {"outcome": "out of time", "cause": "stuck", "lost": Losses(failure=1)}
        facts["text"] = f"world {FIRST + number}: {failed}"
        score = 0.0
    else:
        lost = Losses(standing=(1 - score) / 2, detour=(1 - score) / 2)
        facts = {"outcome": "reached", "lost": lost}
    facts |= {"steps": 100, "seconds": 10.0, "least_steps": 100.0 * score}
    facts |= {"index": FIRST + number, "time_score": score}
    return EpisodeRow(**facts | changes)


def candidate_of(k, *scores, source=None, numbers=None, folder=Path("none")):
    """A candidate with episodes of these scores; None stands for a failure."""
    numbers = range(len(scores)) if numbers is None else numbers
    found = Candidate(k, 0, source or f"A = {k}\n", folder)
    found.pool = [
        row_of(number, score or 0.0, "stuck for ever" if score is None else "")
        for number, score in zip(numbers, scores, strict=True)
    ]
    return found


def member_of(k, *scores, parent=None, founder=False, **about):
    """A member of an archive with episodes of these scores."""
    found = candidate_of(k, *scores, **about)
    return Member(found, figures_of(found.pool), parent, "", founder)


def ranked_member(k, time, **about):
    """A member of which only the mean time score is known."""
    figures = Figures({"time": time}, {"time": "mean time score"})
    return Member(Candidate(k, 0, f"A = {k}\n", Path()), figures, **about)


def archive_of(*members):
    """An archive with members, oldest first."""
    return Archive(members=list(members))
