"""Parallel lanes along one axis of a map, of drawn widths."""

from __future__ import annotations

from tdac_envs.ladder.random_stream import RandomStream

Lane = tuple[int, int]
"""Begin and end of a lane, px, the end excluded."""


def spread(random: RandomStream, widths: list[int], spare: int) -> list[int]:
    """The widths, some of them wider, so that together they fill `spare` px more."""
    wider = list(widths)
    for _ in range(spare if wider else 0):
        wider[random.integer(0, len(wider) - 1)] += 1
    return wider


def lanes_from(begin: int, widths: list[int], between: int = 0) -> list[Lane]:
    """Lanes of these widths one after the other, `between` px apart."""
    lanes = []
    for width in widths:
        lanes.append((begin, begin + width))
        begin += width + between
    return lanes
