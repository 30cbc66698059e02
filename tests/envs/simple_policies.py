"""One action, policies that no bundled map may be solved by, and a driver of paths."""

import itertools
import math
from collections.abc import Callable, Iterator

import numpy as np

LEFT, RIGHT = -1, 1
DT = 0.05


def drive(env, action, steps=10_000):
    """The last step of some with one action, up to the end of the episode."""
    for _ in range(steps):
        result = env.step(action)
        if result[2] or result[3]:
            break
    return result


def steer(pose, bearing: float, robot) -> tuple[float, float]:
    """Wheels that turn to a bearing on the spot, or drive and keep to it."""
    error = math.remainder(bearing - float(pose[2]), 2 * math.pi)
    lead = error * robot.axle_length / (robot.max_wheel_speed * DT)
    if abs(error) > 0.15:
        spin = max(-1.0, min(1.0, lead / 2))
        return (spin, -spin)
    return (1.0, 1.0 - lead) if lead > 0 else (1.0 + lead, 1.0)


def go_straight(obs, robot) -> tuple[float, float]:
    """Drives at the goal."""
    x, y, _ = obs["pose"]
    bearing = math.atan2(obs["goal"][1] - y, obs["goal"][0] - x)
    return steer(obs["pose"], bearing, robot)


def wall_follower(hand: int, robot) -> Callable:
    """A policy that keeps a wall at its left (-1) or right (1) hand.

    It drives ahead to the first wall. From then on it goes in the direction nearest
    to its hand in which the body keeps clear of all points that its rays have hit
    so far.
    """
    angles = robot.angles()
    sweep = -hand * np.radians(np.arange(0, 360, 10))
    body = robot.radius + 2.5
    seen = np.zeros((1024, 1024), bool)
    course: list[float] = []
    glances: list[tuple[float, float, float]] = []

    def look(obs) -> np.ndarray:
        """Notes what the rays hit; the points seen so far near the robot."""
        x, y, heading = map(float, obs["pose"])
        hit = obs["ranges"] < robot.range_max - 1e-3
        reach, at = obs["ranges"][hit], heading + angles[hit]
        column, row = x + reach * np.cos(at), y + reach * np.sin(at)
        seen[np.rint(row).astype(int), np.rint(column).astype(int)] = True
        left, top = max(int(x) - 40, 0), max(int(y) - 40, 0)
        rows, columns = np.nonzero(seen[top : int(y) + 40, left : int(x) + 40])
        points = np.stack([columns + left - x, rows + top - y], axis=1)
        return points[np.linalg.norm(points, axis=1) < body + 8]

    def room(points: np.ndarray, bearings: np.ndarray) -> np.ndarray:
        """Clearance over the next 6 px in each direction."""
        ways = np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
        ahead = np.array([2.0, 4.0, 6.0])[:, None, None] * ways
        gaps = np.linalg.norm(ahead[:, :, None] - points, axis=3)
        return gaps.min(axis=(0, 2), initial=math.inf)

    def wall_side(points: np.ndarray) -> float:
        """Bearing of the followed wall: the nearest point not on the other hand."""
        bearings = np.arctan2(points[:, 1], points[:, 0])
        side = hand * np.remainder(bearings - course[0] + math.pi, 2 * math.pi)
        gaps = np.linalg.norm(points, axis=1)
        gaps[side - hand * math.pi < -0.5] = math.inf
        near = gaps.size > 0 and gaps.min() < math.inf
        return float(bearings[gaps.argmin()]) if near else course[0] + hand * 0.8

    def policy(obs) -> tuple[float, float]:
        x, y, heading = map(float, obs["pose"])
        points = look(obs)
        if not course:
            if room(points, np.array([heading]))[0] > body:
                return (1.0, 1.0)
            course.append(heading - hand * math.pi / 2)
        bearings = wall_side(points) + sweep
        gaps = room(points, bearings)
        bearing = float(
            bearings[(gaps > body).argmax() if gaps.max() > body else gaps.argmax()]
        )
        turned = hand * math.remainder(bearing - course[0], 2 * math.pi)
        if turned > 0.05 and (not glances or math.dist(glances[-1][:2], (x, y)) > 5):
            glances.append((x, y, bearing + hand * 1.2))
        if glances and math.isfinite(glances[-1][2]):
            if abs(math.remainder(glances[-1][2] - heading, 2 * math.pi)) > 0.15:
                return steer(obs["pose"], glances[-1][2], robot)
            glances[-1] = (*glances[-1][:2], math.inf)
        if abs(math.remainder(bearing - heading, 2 * math.pi)) < 0.15:
            course[0] = bearing
        return steer(obs["pose"], bearing, robot)

    return policy


def drive_path(path, heading: float, robot) -> Iterator[tuple[float, float]]:
    """Wheels that follow a polyline exactly: turns in place and straight runs."""
    step = robot.max_wheel_speed * DT
    spin = 2 * step / robot.axle_length
    for (x0, y0), (x1, y1) in itertools.pairwise(_corners(path)):
        bearing = math.atan2(y1 - y0, x1 - x0)
        turn = math.remainder(bearing - heading, 2 * math.pi)
        yield from ((w, -w) for w in _portions(turn / spin))
        yield from ((v, v) for v in _portions(math.hypot(x1 - x0, y1 - y0) / step))
        heading = bearing


def _portions(amount: float) -> list[float]:
    """Numbers of at most 1 in size that add up to the amount."""
    count = max(math.ceil(abs(amount) - 1e-9), 1)
    return [amount / count] * count


def _corners(path) -> list[tuple[float, float]]:
    """The points of a pixel path at which its direction changes, and its ends."""
    points = [p for p, q in itertools.pairwise([*map(tuple, path), None]) if p != q]
    turns = [
        b
        for a, b, c in zip(points, points[1:], points[2:], strict=False)
        if abs((b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])) > 1e-9
    ]
    return [points[0], *turns, points[-1]]
