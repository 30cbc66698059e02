"""Frames, stamps and wheels: poses of a map, commands within the limits of a robot."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from itertools import pairwise
import math
from typing import Any

import numpy as np


def yaw_of(x: float, y: float, z: float, w: float) -> float:
    """Yaw of a quaternion, in (-pi, pi]; NaN if its length is not 1, as tf2 reckons."""
    if not abs(x * x + y * y + z * z + w * w - 1.0) < 0.01:
        return math.nan
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def compose(
    first: tuple[float, float, float], second: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Pose of C in A, from the pose of B in A and the pose of C in B."""
    x, y, yaw = first
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return (
        x + cosine * second[0] - sine * second[1],
        y + sine * second[0] + cosine * second[1],
        wrapped(yaw + second[2]))


def check_pose_parameters(source: str, origin: Sequence[float]) -> None:
    """Raise ValueError if the parameters of the pose are impossible; see `drive.yaml`."""
    if source not in ('tf', 'odom'):
        raise ValueError(f'pose_source: expected tf or odom, got {source!r}')
    if len(origin) != 3 or not all(map(math.isfinite, origin)):
        raise ValueError(f'origin: expected x, y, yaw, got {list(origin)}')


def unfit_stamp(name: str, age: float, oldest: float) -> str:
    """Return why data of an age are too old or too new, or an empty text."""
    if age == math.inf:
        return f'no {name} yet'
    if age > oldest:
        return f'the last {name} is older than {oldest:g} s'
    if -age > oldest:
        return f'the {name} is more than {oldest:g} s ahead of the clock (use_sim_time?)'
    return ''


def unheard(publishers: int, listeners: int) -> str:
    """
    Return why commands may not reach the robot alone, or an empty text.

    Args:
        publishers: How many publish them, this node included.
        listeners: How many take them.
    """
    if publishers != 1:
        who = 'end the others' if publishers else 'this node does not see its own'
        return f'{publishers} publishers of the commands: {who}'
    return '' if listeners else 'nobody takes the commands: is the driver, or the smoother, dead?'


def other_map(
    own: dict[str, Any],
    size: tuple[int, int],
    resolution: float,
    origin: tuple[float, float, float],
) -> str:
    """
    Return how a map differs from the one of the verification, or an empty text.

    Only the header is compared: a map that was scanned again has another size or origin,
    so its places are not those of the task.

    Args:
        own: The map of the verification: `size`, `resolution`, `origin`.
        size: Cells: width, height.
        resolution: Length of a cell, m.
        origin: Pose of its lower left corner.
    """
    x, y, yaw = own['origin']
    off = math.dist(origin[:2], (x, y))
    turn = abs(wrapped(origin[2] - yaw)) if math.isfinite(origin[2]) else math.inf
    apart = abs(resolution - own['resolution']) * max(own['size'])
    if tuple(size) == tuple(own['size']) and off + apart < 0.1 * own['resolution'] and turn < 1e-3:
        return ''

    def text(size: Any, resolution: float, origin: Any) -> str:
        place = ', '.join(f'{each:.4g}' for each in origin)
        return f'{size[0]} x {size[1]} cells of {resolution:.4g} m from ({place})'

    return (
        f'the localiser has another map: {text(size, resolution, origin)}, verified with '
        f'{text(own["size"], own["resolution"], own["origin"])}; give it that map (or, if both '
        f'have one frame, set any_map)')


def inverse(pose: tuple[float, float, float]) -> tuple[float, float, float]:
    """Pose of A in B, from the pose of B in A."""
    x, y, yaw = pose
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return -cosine * x - sine * y, sine * x - cosine * y, -yaw


def wrapped(angle: float) -> float:
    """Angle in (-pi, pi]."""
    return math.pi - (math.pi - angle) % math.tau


class Driven:
    """
    The motion by the last commands.

    A command lasts until the next one, and no longer than the robot's timer.

    Args:
        dead_man: Time of this timer.
    """

    def __init__(self, dead_man: float) -> None:
        self._dead_man = dead_man
        self._commands: deque[tuple[float, float, float]] = deque(maxlen=100)

    def take(self, now: float, v: float, omega: float) -> None:
        """Take a command."""
        self._commands.append((now, v, omega))

    def change(self, v: float, omega: float) -> None:
        """Take another command than the last one."""
        if self._commands:
            self._commands[-1] = (self._commands[-1][0], v, omega)

    def between(self, since: float, until: float) -> tuple[float, float, float]:
        """Return the motion in a time, as a pose in the body's first frame."""
        return self.parts(since, until)[0]

    def parts(self, *times: float) -> list[tuple[float, float, float]]:
        """Return the motion from each time to the next one, each as a pose in its first frame."""
        moved = [(0.0, 0.0, 0.0)] * (len(times) - 1)
        steps = list(self._commands)
        steps.append((max(*times, steps[-1][0] if steps else times[-1]), 0.0, 0.0))
        for (begin, v, omega), (end, _, _) in pairwise(steps):
            for i, (since, until) in enumerate(pairwise(times)):
                lasted = min(end, until, begin + self._dead_man) - max(begin, since)
                if lasted > 0.0:
                    moved[i] = compose(moved[i], _arc(v, omega, lasted))
        return moved


def _arc(v: float, omega: float, lasted: float) -> tuple[float, float, float]:
    """Return the motion of a command that lasted some time."""
    half = 0.5 * omega * lasted
    chord = v * lasted * float(np.sinc(half / math.pi))
    return chord * math.cos(half), chord * math.sin(half), 2.0 * half


class Wheels:
    """Fractions of the full wheel speed, within the robot's limits, as in the verification."""

    def __init__(self, robot: dict[str, Any], dt: float) -> None:
        full, axle = float(robot['max_wheel_speed']), float(robot['axle_length'])
        self.full, self.axle = full, axle
        self.last = (0.0, 0.0)

        def share(name: str, scale: float, most: float) -> float:
            return min(robot[name] * scale / full, most) if robot.get(name) else most

        self._change = share('max_acceleration', dt, 2.0)
        self._sum = share('max_speed', 2.0, 2.0)
        self._apart = share('max_turn_rate', axle, 2.0)
        self._turn = share('max_turn_acceleration', dt * axle, 4.0)

    def limited(self, left: float, right: float) -> tuple[float, float]:
        """Next fractions: clipped, on the same curve within the limits, and ramped."""
        left, right = min(max(left, -1.0), 1.0), min(max(right, -1.0), 1.0)
        both, apart = abs(left + right), abs(left - right)
        if both > self._sum or apart > self._apart:
            part = min(self._sum / max(both, self._sum), self._apart / max(apart, self._apart))
            left, right = part * left, part * right
        before_left, before_right = self.last
        left = min(max(left, before_left - self._change), before_left + self._change)
        right = min(max(right, before_right - self._change), before_right + self._change)
        turn = left - right - (before_left - before_right)
        if abs(turn) > self._turn:
            beyond = 0.5 * (turn - math.copysign(self._turn, turn))
            left, right = left - beyond, right + beyond
        self.last = left, right
        return self.last

    def twist(self, left: float, right: float) -> tuple[float, float]:
        """Speed (m/s) and turn rate (rad/s) of wheel fractions."""
        return 0.5 * (left + right) * self.full, (right - left) * self.full / self.axle

    def fractions(self, v: float, omega: float) -> tuple[float, float]:
        """Inverse of `twist`."""
        half = 0.5 * omega * self.axle
        return (v - half) / self.full, (v + half) / self.full
