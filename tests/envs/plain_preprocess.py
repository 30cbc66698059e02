"""The literal grid of Algorithm 1, each of its candidates on its own; an oracle.

Nothing is shared between candidates: each cleans, measures clearance, labels what is
connected and plans on a whole distance field.
"""

from __future__ import annotations

import cv2
import numpy as np

from tdac_envs.grid.grid import body_free, clearance
from tdac_envs.grid.pieces import nearest_free
from tdac_envs.grid.plan import descend, distance_field, path_length
from tdac_envs.mapping.image import from_array, luminance
from tdac_envs.mapping.params import ScoreTerms
from tdac_envs.mapping.readings import plain_reading
from tdac_envs.mapping.scene import MapProblem

SQUARE = np.ones((3, 3), np.uint8)


def clean(cells, strength):
    """Without small pieces and holes, closed."""
    if strength == 0:
        return cells
    kept = without_small(cells, strength, 8)
    filled = ~without_small(~kept, strength, 4)
    return cv2.morphologyEx(filled.astype(np.uint8), cv2.MORPH_CLOSE, SQUARE) > 0


def without_small(mask, smallest, connectivity):
    """The pieces of at least so many pixels."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(
        mask.astype(np.uint8), connectivity=connectivity
    )
    keep = stats[:, cv2.CC_STAT_AREA] >= smallest
    keep[0] = False
    return keep[labels]


def connected(free, start, goal):
    """Whether two pixels are joined."""
    labels = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)[1]
    return bool(free[start[::-1]]) and labels[start[::-1]] == labels[goal[::-1]]


def widest(clear, start, goal):
    """Largest radius that gets through, by bisection."""
    if not connected(body_free(clear, 0.0), start, goal):
        return -1.0
    low, high = 0.0, float(min(clear[start[::-1]], clear[goal[::-1]]))
    while high - low > 0.1:
        middle = (low + high) / 2
        if connected(body_free(clear, middle), start, goal):
            low = middle
        else:
            high = middle
    return float(np.floor(low * 10) / 10)


def outside(cells, start, goal):
    """Which end is on free space that reaches the border, if the other is not."""
    labels = cv2.connectedComponents((~cells).astype(np.uint8), connectivity=4)[1]
    rim = np.ones_like(cells)
    rim[1:-1, 1:-1] = False
    at = [labels[end[::-1]] for end in (start, goal)]
    open_ = [label in labels[rim] for label in at]
    if at[0] == at[1] or not all(at) or open_[0] == open_[1]:
        return None
    return "start" if open_[0] else "goal"


def failure(cells, clear, free, start, goal, radius, inflation):
    """Which check fails, or None."""
    robot = f"a robot of {radius:g} px radius"
    robot += f" and a margin of {inflation} px" if inflation else ""
    beyond = outside(cells, start, goal)
    for name, (x, y), other in (("start", start, goal), ("goal", goal, start)):
        if free[y, x] if beyond is None else name != beyond:
            continue
        what = f"is {clear[y, x]:.1f} px from an obstacle, too near"
        what = "lies in an obstacle" if cells[y, x] else what
        able = free
        if beyond is not None:
            opposite = "goal" if name == "start" else "start"
            what = f"lies outside of the closed wall around {opposite} {other}"
            room = cv2.connectedComponents((~cells).astype(np.uint8), connectivity=4)[1]
            able = free & (room == room[other[::-1]])
        pieces = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)[1]
        joined = pieces == pieces[other[::-1]] if free[other[::-1]] else able
        near = nearest_free(joined, x, y)
        reach = " from which the goal can be reached"
        reach = " that can be reached from the start" if name == "goal" else reach
        reach = reach if free[other[::-1]] else ""
        text = f"the nearest free pixel for {robot}{reach}"
        problem = f"{name} ({x}, {y}) {what}"
        text = f"move the {name} to {near}, {text}: {problem}"
        text = f"{problem}; {robot} fits nowhere on this map" if near is None else text
        room = widest(clear, start, goal)
        way = f"from this start to this goal a radius of {room:.1f} px gets through"
        return f"{text}{f'; {way}' if room >= 0.5 else ''}"
    if connected(free, start, goal):
        return None
    room = widest(clear, start, goal)
    advice = f"the largest radius that gets through is {room:.1f} px"
    advice = "no robot gets through: a wall blocks the way" if room < 0.5 else advice
    return f"start {start} and goal {goal} are not connected for {robot}; {advice}"


def terms(cells, clear, free, start, goal):
    """Terms of the score."""
    path = descend(free, distance_field(free, goal), start)
    columns, rows = path.astype(int).T
    flips = (cells[1:] != cells[:-1]).sum() + (cells[:, 1:] != cells[:, :-1]).sum()
    return ScoreTerms(
        min_clearance=float(clear[rows, columns].min()),
        path_length=path_length(path),
        sharpness=int(flips) / cells.size,
    )


def candidates(picture, start, goal, radius):
    """Of each: polarity, cleanup, inflation, cells, failure and terms; best first."""
    scene = MapProblem(from_array(picture), luminance(picture), start, goal, radius)
    found = []
    for light_free in (True, False):
        base = plain_reading(scene, light_free)
        for strength in (0, 4, 8, 12, 16):
            for inflation in (0, 1, 2, 3):
                cells = clean(base.cells, strength)
                clear = clearance(cells)
                free = body_free(clear, radius + inflation)
                task = (start, goal, radius, inflation)
                why = failure(cells, clear, free, *task)
                values = None if why else terms(cells, clear, free, start, goal)
                who = (base.polarity, strength, inflation)
                found.append((*who, cells, why, values))
                if why:
                    break
    return sorted(found, key=lambda c: (c[4] is not None, -value(c[5])))


def value(values):
    """Score of Algorithm 1."""
    if values is None:
        return -np.inf
    near, length, edges = values.min_clearance, values.path_length, values.sharpness
    return sum((2.5 * near, -0.02 * length, -1.2 * edges))
