"""A cursor that the keyboard moves over the picture of a map or world."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tdac_agent.studio.source_view import Place, SourceView

ARROWS = {
    "ArrowLeft": (-1, 0),
    "ArrowRight": (1, 0),
    "ArrowUp": (0, -1),
    "ArrowDown": (0, 1),
}
"""Keys, with the direction of each on the picture: right, down."""
STEP = {"px": 1.0, "m": 0.01}
"""How far a key moves the cursor, by the unit of places."""
FAR = 10
"""Steps of a key with Shift."""
COLOUR = "#b0217a"


@dataclass(frozen=True, slots=True)
class MapCursor:
    """Where the cursor is.

    Attributes:
        place: In the unit of its view.
    """

    place: Place

    @classmethod
    def on(cls, view: SourceView, place: Place | None) -> MapCursor:
        """A cursor at a place, or in the middle of the picture."""
        if place is None:
            place = view.place(view.width / 2, view.height / 2)
        return cls(_rounded(place, view))

    def moved(self, view: SourceView, key: str, *, far: bool) -> MapCursor:
        """The cursor after an arrow key; at the edge of the picture it stays.

        Args:
            view: The picture.
            key: A key of `ARROWS`.
            far: Whether Shift is pressed, too.
        """
        cursor = self
        for _ in range(FAR if far else 1):
            cursor = cursor._one_step(view, *ARROWS[key])
        return cursor

    def _one_step(self, view: SourceView, right: int, down: int) -> MapCursor:
        step, (x, y) = STEP[view.unit], self.place
        x += math.copysign(step, view.scale[0]) * right
        y += math.copysign(step, view.scale[1]) * down
        ((over, below),) = view.at([(x, y)]).tolist()
        inside = 0 <= over < view.width and 0 <= below < view.height
        return MapCursor(_rounded((x, y), view)) if inside else self

    def told(self, view: SourceView) -> str:
        """Where it is, and how much room is there, for a screen reader."""
        x, y = self.place
        text = f"Cursor at {x:g}, {y:g} {view.unit}"
        if view.room is None:
            return f"{text}."
        room = view.room(self.place)
        if room <= 0.0:
            return f"{text}: in an obstacle."
        return f"{text}: free, {room:.0f} px from the nearest obstacle."

    def svg(self, view: SourceView) -> str:
        """A cross at the place, as SVG over the picture."""
        ((x, y),) = view.at([self.place]).tolist()
        thick = max(view.width, view.height) / 400
        arm, gap = 9 * thick, 2 * thick
        path = "".join(
            f"M{x + gap * a:.1f},{y + gap * b:.1f}L{x + arm * a:.1f},{y + arm * b:.1f}"
            for a, b in ARROWS.values()
        )
        return "".join(
            f'<path d="{path}" class="cursor" stroke="{colour}" '
            f'stroke-width="{width * thick:.2f}"/>'
            for colour, width in (("white", 3.0), (COLOUR, 1.5))
        )


def _rounded(place: Place, view: SourceView) -> Place:
    """The middle of a pixel, or a whole centimetre."""
    digits = 0 if view.unit == "px" else 2
    return round(place[0], digits) + 0.0, round(place[1], digits) + 0.0
