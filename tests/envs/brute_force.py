"""Slow and obvious answers to what the kernels compute: square by square."""

import math

import numpy as np


def squares(cells):
    """Centres (n, 2) of all occupied squares, with a rim of two around the map."""
    rows, columns = np.nonzero(np.pad(cells, 2, constant_values=True))
    return np.stack([columns - 2, rows - 2], axis=1).astype(float)


def distance(cells, x, y):
    """From points x, y (any shape) to the nearest occupied square, px."""
    x, y = np.asarray(x, float)[..., None], np.asarray(y, float)[..., None]
    centres = squares(cells)
    dx = np.maximum(np.abs(centres[:, 0] - x) - 0.5, 0.0)
    dy = np.maximum(np.abs(centres[:, 1] - y) - 0.5, 0.0)
    return np.hypot(dx, dy).min(axis=-1)


def ray(cells, x, y, angle, range_max):
    """Where the ray enters the first occupied square, by the slab test."""
    centres = squares(cells)
    enter, leave = np.zeros(len(centres)), np.full(len(centres), np.inf)
    for centre, origin, way in (
        (centres[:, 0], x, math.cos(angle)),
        (centres[:, 1], y, math.sin(angle)),
    ):
        near, far = centre - 0.5 - origin, centre + 0.5 - origin
        if way == 0.0:
            # Half open, as pixels are: the border belongs to the next one.
            leave[(near > 0.0) | (far <= 0.0)] = -1.0
            continue
        enter = np.maximum(enter, np.minimum(near / way, far / way))
        leave = np.minimum(leave, np.maximum(near / way, far / way))
    return min(enter[enter < leave].min(initial=range_max), range_max)


def arc(x, y, heading, forward, turn, parts):
    """Centres after parts of the step: the speed, integrated by Gauss and Legendre."""
    nodes, weights = np.polynomial.legendre.leggauss(30)
    parts = np.asarray(parts, float)
    headings = heading + turn * parts[..., None] * (nodes + 1.0) / 2.0
    way = forward * parts / 2.0
    return x + way * (np.cos(headings) @ weights), y + way * (
        np.sin(headings) @ weights
    )


def shortest(free, start, goal):
    """Octile length by Bellman and Ford: relax all steps until nothing changes."""
    length = np.full(np.pad(free, 1).shape, np.inf)
    room = np.pad(free, 1)
    if not (free[start[::-1]] and free[goal[::-1]]):
        return math.inf
    length[goal[1] + 1, goal[0] + 1] = 0.0
    steps = [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1) if a or b]
    while True:
        before = length.copy()
        for dx, dy in steps:
            there = np.roll(length, (dy, dx), (0, 1))
            beside = np.roll(room, dy, 0) & np.roll(room, dx, 1)
            allowed = room & np.roll(room, (dy, dx), (0, 1)) & beside
            through = np.where(allowed, there + math.hypot(dx, dy), np.inf)
            length = np.minimum(length, through)
        if (length == before).all():
            return float(length[start[1] + 1, start[0] + 1])
