"""How hard a world is, as numbers."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Difficulty:
    """Figures of a static world and its task; multiples of 2**-16.

    `dead_ends.dead_ends` computes the depth of dead ends, which takes longer.

    Attributes:
        gap: Twice the clearance at the narrowest place of the widest path from start to
            goal, divided by the body's diameter.
        length: L, the length of the disc's shortest path, px, rounded down.
        steps: OT, the least number of steps to the goal at full speed:
            (L - tolerance) / step. No drive takes less.
        detour: L divided by the straight distance.
        in_sight: Share of the shortest path from which no obstacle hides the goal.
        density: Share of occupied pixels.
    """

    gap: float
    length: float
    steps: float
    detour: float
    in_sight: float
    density: float
