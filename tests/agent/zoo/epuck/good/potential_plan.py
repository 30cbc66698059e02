# idea: a pure potential field whose attraction runs along a planned way
# profile: policy
import math
import re

import numpy as np
import sensors

SIZE = 0.01
BODY = 0.037
TEXT = (sensors.HERE / "world.wbt").read_text(encoding="utf-8")
SPLIT = re.compile(r"^\}\n", re.MULTILINE)


def values(text, name, count):
    words = re.search(rf"\b{name} (.*)", text)
    return [float(word) for word in words[1].split()] if words else [0.0] * count


def place(text):
    head = text.split("children")[0]
    yaw = values(head, "rotation", 4)[3]
    return complex(*values(head, "translation", 3)[:2]), np.exp(1j * yaw)


def read():
    """Convex outlines (complex corners, radius), and the arena."""
    solids, arena = [], None
    for node in SPLIT.split(TEXT):
        head, found, shape = node.partition("boundingObject ")
        if "RectangleArena {" in node:
            half = [side / 2 for side in values(node, "floorSize", 2)]
            arena = (*place(node[node.index("RectangleArena {") :]), half)
        if not found:
            continue
        at, turn = place(head)
        parts = shape.split("Pose {")
        for part in parts[1:] or parts:
            inner, more = place(part) if parts[1:] else (0j, 1.0)
            corners, radius = outline(part)
            solids.append((at + turn * (inner + more * corners), radius))
    return solids, arena


def outline(part):
    if "radius" in part:
        return np.zeros(1, complex), values(part, "radius", 1)[0]
    if "size" in part:
        a, b, _ = values(part, "size", 3)
        return np.array([-a - b * 1j, a - b * 1j, a + b * 1j, b * 1j - a]) / 2, 0.0
    listed = re.search(r"point \[([^]]*)", part)[1].split()
    points = np.array(listed, float).reshape(-1, 3)
    flat = np.unique(points[:, 0] + 1j * points[:, 1])
    return flat[np.argsort(np.angle(flat - flat.mean()))], 0.0


SOLIDS, (MIDDLE, TURN, HALF) = read()


def room(places):
    """Distance of places (complex) to the nearest solid thing."""
    own = (places - MIDDLE) / TURN
    least = np.minimum(HALF[0] - abs(own.real), HALF[1] - abs(own.imag))
    for corners, radius in SOLIDS:
        gap, depth = np.full(places.shape, np.inf), np.full(places.shape, -np.inf)
        for begin, end in zip(corners, np.roll(corners, -1), strict=True):
            side = end - begin if end != begin else 1e-9
            seen = (places - begin) / side
            off = seen - np.clip(seen.real, 0.0, 1.0)
            gap = np.minimum(gap, abs(off * side))
            depth = np.maximum(depth, -seen.imag * abs(side))
        least = np.minimum(least, np.where(depth < 0, depth, gap) - radius)
    return least


REACH = math.hypot(*HALF)
AXIS = np.arange(-REACH, REACH, SIZE)
PLACES = MIDDLE + AXIS[None, :] + 1j * AXIS[:, None]
ROOM = room(PLACES)
GRAD_Y, GRAD_X = np.gradient(ROOM, SIZE)


def field(goal):
    """Number of steps to the goal over places with room, by growing from it."""
    free, wave = ROOM > BODY + 0.008, np.full(ROOM.shape, np.inf)
    row, column = index_of(goal)
    wave[row, column] = 0.0
    while True:
        best = np.pad(wave, 1, constant_values=np.inf)
        straight = np.minimum.reduce(
            [best[:-2, 1:-1], best[2:, 1:-1], best[1:-1, :-2], best[1:-1, 2:]]
        )
        slanted = np.minimum.reduce(
            [best[:-2, :-2], best[2:, 2:], best[2:, :-2], best[:-2, 2:]]
        )
        after = np.minimum(wave, np.minimum(straight + 1.0, slanted + 1.5))
        after = np.where(free, after, np.inf)
        if np.array_equal(after, wave):
            return wave
        wave = after


def index_of(place):
    off = complex(place) - MIDDLE
    return round((off.imag + REACH) / SIZE), round((off.real + REACH) / SIZE)


WAVE = []


def reset(obs):
    WAVE[:] = [field(complex(*obs["goal"].tolist()))]


def force(here, goal):
    """Along the way, and away from what is near."""
    row, column = index_of(here)
    rows, columns = slice(row - 3, row + 4), slice(column - 3, column + 4)
    best = np.argmin(WAVE[0][rows, columns])
    pull = PLACES[rows, columns].flat[best] - here
    if abs(goal - here) < 0.05:
        pull = goal - here
    pull /= max(abs(pull), 1e-9)
    push = complex(GRAD_X[row, column], GRAD_Y[row, column])
    near = max(0.0, 0.012 - (ROOM[row, column] - BODY)) / 0.012
    return pull + 0.8 * near * push


def policy(obs):
    if not WAVE:
        reset(obs)
    x, y, yaw = obs["pose"].tolist()
    goal, here = complex(*obs["goal"].tolist()), complex(x, y)
    pulled = force(here, goal) * np.exp(-1j * yaw)
    error = math.atan2(pulled.imag, pulled.real)
    turn = float(np.clip(0.7 * error, -0.5, 0.5))
    ahead = 0.65 * max(0.0, math.cos(error)) ** 4
    return ahead - turn, ahead + turn
