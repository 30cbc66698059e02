"""The smallest gap of an episode: how much, where, and whether it suffices."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

from pydantic import Field

from tdac_agent.storage.printable_record import StrictRecord
from tdac_agent.tasks.units import Units

TOO_CLOSE = "too close"
_SMALL = 0.1
"""Smaller gaps in metres are printed in mm."""


class Gap(StrictRecord):
    """The smallest gap between body and obstacles in an episode.

    Lengths and positions are in px, for the e-puck in m. The place is None where it
    must not be told: in hidden worlds.
    """

    gap: float = Field(description="The gap; 0 with a contact.")
    radii: float = Field(description="The same, as a share of the body radius.")
    required: float = Field(description="The gap that the robot should keep.")
    step: int | None = Field(None, description="Its step; 0 at the start.")
    x: float | None = Field(None, description="Place of the robot's centre there.")
    y: float | None = None
    heading: float | None = Field(None, description="Heading there, rad.")
    thing: str | None = Field(None, description="What was nearest.")
    close: Gap | None = Field(
        None,
        description="The smallest gap that was too close: smaller than required, and "
        "than one that the robot had before. None without any.",
    )

    @property
    def too_close(self) -> bool:
        """Whether the robot came too close, on the way from where it started."""
        return self.close is not None


def gap_figure(length: float, units: Units) -> str:
    """Formats a gap with three digits: `0.412 px`, `6.13 mm`."""
    if units.shown is None:
        return units.figure(length)
    shown, name = length * units.scale * units.shown.per_pixel, units.shown.name
    if name == "m" and shown < _SMALL:
        shown, name = 1000.0 * shown, "mm"
    return f"{shown:.3g} {name}"


def gap_text(gap: Gap, units: Units, *, placed: bool = True) -> str:
    """A gap in words: `0.4 mm (1.1 % of the radius) to the wall at (1, 2) in step 3`.

    Args:
        gap: The gap.
        units: Units of the text.
        placed: Whether to tell the place.
    """
    text = f"{gap_figure(gap.gap, units)} ({100 * gap.radii:.2g} % of the radius)"
    if gap.thing is not None:
        article = "" if gap.thing.startswith("mover ") else "the "
        text += f" to {article}{gap.thing}"
    if placed and gap.x is not None and gap.y is not None:
        (place,) = units.on_screen([(gap.x, gap.y)]).tolist()
        text += f" at {units.point(*place)}"
    if gap.step is None:
        return text
    return f"{text} in step {gap.step}" if gap.step else f"{text} at the start"


def too_close_text(gap: Gap, units: Units, *, placed: bool = True) -> str:
    """Says where the robot came too close.

    Args:
        gap: The smallest gap of an episode, or the smallest one that was too close.
        units: Units of the text.
        placed: Whether to tell the place.
    """
    near, required = gap.close or gap, gap_figure(gap.required, units)
    text = gap_text(near, units, placed=placed)
    return f"{TOO_CLOSE}: {text}; required {required}"


G = TypeVar("G")


def closest(episodes: Iterable[tuple[G, Gap | None]]) -> tuple[G, Gap] | None:
    """The episode with the smallest gap, and its gap; None without any."""
    known = [(each, gap) for each, gap in episodes if gap is not None]
    return min(known, key=lambda pair: pair[1].gap, default=None)
