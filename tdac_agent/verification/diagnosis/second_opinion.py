"""A second opinion on a controller in words, and as a test."""

from __future__ import annotations

from tdac_agent.tasks.units import Units
from tdac_agent.verification.diagnosis.gap import gap_figure
from tdac_agent.verification.diagnosis.report import (
    Failure,
    OtherEpisode,
    SecondOpinion,
)

TEST = "second_opinion[{}]"
"""Id of the test that `--require-physics` adds, with the name of the physics."""


def opinion_text(opinion: SecondOpinion, units: Units) -> str:
    """The opinion in one line.

    Such as `second opinion (MuJoCo 4.0): 6 of 6 arrive; smallest gap 19.6 mm with the
    exact step, 19.5 mm with MuJoCo`.
    """
    name, _, version = opinion.engine.partition(" ")
    about = f"{name} {'.'.join(version.split('.')[:2])}"
    about += ", varied" if opinion.varied else ""
    about += ", with its rays" if opinion.measured else ""
    if opinion.scaled:
        about += ", with a body radius of 0.1 m"
    text = f"second opinion ({about}): {arrivals_text(opinion)}"
    here, there = (
        min((g for g in gaps if g is not None), default=None)
        for gaps in (
            [each.exact_gap for each in opinion.episodes],
            [each.gap for each in opinion.episodes],
        )
    )
    if here is not None and there is not None:
        text += f"; smallest gap {gap_figure(here, units)} with the exact step, "
        text += f"{gap_figure(there, units)} with {name}"
    return text


def arrivals_text(opinion: SecondOpinion) -> str:
    """How many arrive, and how the others end."""
    text = f"{opinion.arrivals} of {len(opinion.episodes)} arrive"
    others = [_ending(each) for each in opinion.episodes if not each.arrives]
    return text if not others else f"{text} ({', '.join(others)})"


def _ending(episode: OtherEpisode) -> str:
    return f"{episode.name}: {episode.outcome} in step {episode.steps}"


def as_test(
    opinion: SecondOpinion | None, physics: str
) -> tuple[dict[str, str], list[Failure]]:
    """The outcome of a required opinion: a test, and its failure if it failed.

    Args:
        opinion: The opinion; None if there was nothing to drive again.
        physics: Name of the physics.
    """
    name = TEST.format(physics)
    if opinion is not None and opinion.agrees:
        return {name: "passed"}, []
    message = "not driven, since no episode reached the goal"
    if opinion is not None:
        message = f"expected all episodes to arrive: {arrivals_text(opinion)}"
    return {name: "failed"}, [Failure(test=name, group="end to end", message=message)]
