"""Scans: what the controller observes of them, and what is in the robot's way."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from .motion import yaw_of

MOST_MISSING = 0.2
"""Largest share of rays without a value in a scan that counts."""
MOST_ZERO = 0.5
"""
Largest share of rays that read nothing, zeros of a near obstacle among them.

A flat wall is in less than half of all directions.
"""
MOST_RAYS = 20_000
MOST_OFF = 0.02
"""Largest distance of the scanner from where the robot file has it."""
NOISY_FROM = 0.5
"""
Range below which the error of a range does not shrink, m.

The data sheet of the LDS-01 has +-15 mm up to 0.499 m, and an error in percent beyond.
"""
LONGEST_SCAN = 1.0
"""Longest time from the first ray of a scan to its last, s."""
BEARING = 0.1
"""Step of the bearings on which a point may lie, rad."""
_NEAR, _NONE = -1.0, 1e9


class LayoutError(ValueError):
    """A scan is not that of the robot that the controller was verified with."""


@dataclass(frozen=True)
class Layout:
    """
    Header of a scan: angles of its rays, and the ranges that count.

    Attributes:
        count: Number of rays.
        first: Angle of the first ray, from the scanner's own x axis.
        step: Angle between two rays, counter-clockwise.
        range_min: Smallest valid range.
        range_max: Largest one.
        mount: Yaw of the scanner on the robot.
    """

    count: int
    first: float
    step: float
    range_min: float
    range_max: float
    mount: float = 0.0

    def angles(self) -> np.ndarray[Any, Any]:
        """Angles from the robot's heading, in order."""
        return np.asarray(self.mount + self.first + self.step * np.arange(self.count))


def mounted(
    robot: dict[str, Any], place: tuple[float, float], turn: tuple[float, float, float, float]
) -> float:
    """
    Return the yaw of the scanner on the robot.

    Args:
        robot: See `settings.json`.
        place: Where the scanner is on the robot.
        turn: Its quaternion: x, y, z, w.

    Raises LayoutError if it is not where the robot file has it, or not level.
    """
    offset = robot.get('scanner_offset') or (0.0, 0.0)
    if not math.dist(place, offset) <= MOST_OFF:
        raise LayoutError(
            f'the scanner is at ({place[0]:.3f}, {place[1]:.3f}) m on the robot, the robot '
            f'file has ({offset[0]:g}, {offset[1]:g})')
    yaw = yaw_of(*turn)
    if math.isnan(yaw) or max(abs(turn[0]), abs(turn[1])) > 0.02:
        raise LayoutError('the scanner is tilted or upside down: not supported')
    return yaw


def oldest_ray(count: int, scan_time: float, time_increment: float) -> float:
    """
    Return how much older than its stamp a ray of a scan may be: s.

    The stamp should be that of the first ray, but some drivers stamp the end of the scan.

    Raises LayoutError if the header has no possible times.
    """
    age = max(scan_time, abs(time_increment) * (count - 1))
    if not 0.0 <= age <= LONGEST_SCAN:
        raise LayoutError(
            f'the header of the scan has no valid times: scan_time {scan_time:g} s, '
            f'time_increment {time_increment:g} s')
    return float(age)


class Scanner:
    """
    The task's rays from the scans of the robot.

    A ray of the task reads the nearest return in its sector, halfway to its neighbours. A
    task with rays of its own (`is_scanner`) takes scans of this scanner alone.

    Args:
        robot: See `settings.json`.
        resample: Whether it takes scans of this scanner with another number of rays, which may
            change, and with gaps: a direction that a scan does not have is missing. The guard
            then sees the task's rays.
    """

    def __init__(self, robot: dict[str, Any], resample: bool = False) -> None:
        self.robot, self.resample = robot, resample
        self.angles = np.asarray(robot['ray_angles'], np.float64)
        self.range_max = float(robot['range_max'])
        least = float(robot.get('range_min') or 0.0)
        blind = {'range_max': self.range_max, 'range_min': least, 'zero': 0.0}
        self.blind = blind.get(str(robot.get('below_min')))
        self.zero_is_near = self._can_be_near()
        gaps = np.abs(_turns(np.diff(np.concatenate([self.angles, self.angles[:1]]))))
        self._gap = float(gaps[:-1].max()) if len(gaps) > 1 else 0.1
        self._layout: Layout | None = None
        self._sector = self._own = np.zeros(0, np.int64)
        self._unseen = np.zeros(0, bool)

    def _can_be_near(self) -> np.ndarray[Any, Any]:
        """
        Return the rays in which something may be too near to be measured.

        In the others the body itself reaches as far as the smallest range: what would be
        nearer was touched before.
        """
        if self.robot.get('below_min') != 'zero':
            return np.zeros(len(self.angles), bool)
        x, y = self.robot.get('scanner_offset') or (0.0, 0.0)
        along = x * np.cos(self.angles) + y * np.sin(self.angles)
        rest = along**2 + float(self.robot['radius']) ** 2 - x**2 - y**2
        edge = np.sqrt(np.maximum(rest, 0.0)) - along
        return np.asarray(edge < float(self.robot.get('range_min') or 0.0))

    def use(self, layout: Layout) -> None:
        """
        Assign the rays of a scan to those of the task, once per layout.

        Raises LayoutError if the scan is not that of the robot, or does not see enough.
        """
        if layout == self._layout:
            return
        if not 1 <= layout.count <= MOST_RAYS:
            raise LayoutError(f'expected a scan of 1 to {MOST_RAYS} rays, got {layout.count}')
        turns = abs(layout.first) + abs(layout.step) * layout.count + abs(layout.mount)
        if not turns < 4.0 * math.tau or layout.step == 0.0:
            raise LayoutError('the header of the scan has no valid angles')
        if not 0.0 <= layout.range_min < layout.range_max:
            raise LayoutError(
                f'the header of the scan has no valid ranges: {layout.range_min:g} to '
                f'{layout.range_max:g} m')
        if self.robot.get('is_scanner') and not self.resample:
            self._check(layout)
        if layout.range_max < 0.99 * self.range_max:
            raise LayoutError(
                f'the scan reaches {layout.range_max:g} m, the robot file {self.range_max:g} m')
        apart = np.abs(_turns(layout.angles()[:, None] - self.angles[None, :]))
        nearest, ray = apart.min(axis=0), apart.argmin(axis=0)
        unseen = nearest > 0.5 * self._gap + abs(layout.step) + 1e-6
        if unseen.any() and not self.resample:
            i = int(nearest.argmax())
            raise LayoutError(
                f'the scan does not see {math.degrees(self.angles[i]):.0f} degrees from the '
                f'heading (left is positive), where ray {i} of the task points')
        sector = apart.argmin(axis=1)
        inside = apart[np.arange(layout.count), sector] <= 0.5 * self._gap + 1e-6
        self._sector = np.where(inside, sector, -1)
        self._own, self._unseen = ray, unseen
        self._layout = layout

    def _check(self, layout: Layout) -> None:
        own, count = self.angles, len(self.angles)
        seen = layout.angles()
        last = float(_turns(seen[-1] - own[-1]))
        if layout.count != count or max(abs(_turns(seen[0] - own[0])), abs(last)) > self._gap:
            way = 'counter-clockwise' if layout.step > 0 else 'clockwise'
            raise LayoutError(
                f'the scan has {layout.count} rays from {seen[0]:.3g} to {seen[-1]:.3g} rad '
                f'({way}), the robot file {count} from {own[0]:.3g} to {own[-1]:.3g}: '
                f'verify with a robot file of this scanner, check its mounting, or set '
                f'resample_scan if only the number of rays differs')

    def guard_angles(self) -> np.ndarray[Any, Any]:
        """Angles of the rays for the guard, from the robot's heading."""
        assert self._layout is not None
        return self.angles if self.resample else self._layout.angles()

    def read(self, ranges: Any) -> tuple[np.ndarray[Any, Any] | None, np.ndarray[Any, Any]]:
        """
        Ranges of the task's rays, float32, and those of `guard_angles` for the guard.

        The first is None if too many rays have no value. Of the second, NaN is unknown, and inf
        is free. A range of 0 is one without a return, as many drivers publish it; one between
        0 and the smallest range, or -inf, is something too near, which the guard sees at the
        smallest range. Where the robot file says that a ray
        reads 0 below the smallest range, a 0 counts as a value only in directions in which
        something can be so near, and only if at most `MOST_ZERO` of the rays read nothing.
        """
        assert self._layout is not None
        raw = np.asarray(ranges, np.float64)
        if raw.shape != (self._layout.count,):
            return None, np.full(len(self.guard_angles()), np.nan)
        missing = np.isnan(raw) | (raw == 0.0)
        near = (raw < self._layout.range_min) & ~missing
        value = np.where(raw > self.range_max, self.range_max, raw)
        if self.robot.get('below_min') == 'range_min':
            value = np.maximum(value, float(self.robot.get('range_min') or 0.0))
        value = np.where(near, _NEAR, np.where(missing, _NONE, value))
        found = np.full(len(self.angles), _NONE)
        inside = self._sector >= 0
        np.minimum.at(found, self._sector[inside], value[inside])
        found = np.where(found == _NONE, value[self._own], found)
        found = np.where(self._unseen, _NONE, found)
        nothing = found == _NONE
        zero = nothing & (raw[self._own] == 0.0)
        unexplained = nothing & ~(zero & self.zero_is_near)
        if self.robot.get('below_min') == 'zero':
            found[zero] = 0.0
        lost = found == _NONE
        task = None
        if unexplained.mean() <= MOST_MISSING and nothing.mean() <= MOST_ZERO:
            least = self._layout.range_min if self.blind is None else self.blind
            task = np.where(found == _NEAR, least, _filled(found, lost))
            task = task.astype(np.float32)
        guard = np.maximum(np.where(raw > self.range_max, np.inf, raw), self._layout.range_min)
        guard = np.where(missing, np.nan, guard)
        return task, self._resampled(guard) if self.resample else guard

    def _resampled(self, guard: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        """Return the nearest range in the sector of each ray of the task; NaN is unknown."""
        found, inside = np.full(len(self.angles), np.nan), self._sector >= 0
        np.fmin.at(found, self._sector[inside], guard[inside])
        empty = np.bincount(self._sector[inside], minlength=len(found)) == 0
        found = np.where(empty, guard[self._own], found)
        return np.where(self._unseen, np.nan, found)


class Guard:
    """
    What lies in the robot's way, from scans alone.

    Something near on which the ray has no value now stays where it was, until this direction
    reads again: what is too near to be measured is not gone.

    Args:
        robot: See `settings.json`.
        reaction: Time for which the body drives on by a command, once a later one stops it: a
            control period, and the latency.
    """

    def __init__(self, robot: dict[str, Any], reaction: float) -> None:
        self.radius, self.stop = float(robot['radius']), float(robot['stopping_distance'])
        self.reaction = reaction
        self.offset = np.asarray(robot.get('scanner_offset') or (0.0, 0.0), np.float64)
        self.keep = float(robot.get('range_min') or 0.0) + 2.0 * (self.radius + self.stop)
        least = self.radius + self.stop + float(np.hypot(*self.offset))
        self.error = 2.0 * float(robot.get('range_noise') or 0.0) * max(least, NOISY_FROM)
        self.points = np.zeros((0, 2))

    def see(
        self, ranges: np.ndarray[Any, Any], angles: np.ndarray[Any, Any],
        moved: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> None:
        """
        Take the ranges of a scan.

        Args:
            ranges: Ranges; NaN is unknown, inf is free.
            angles: Their angles from the heading.
            moved: Motion since the last scan, as the pose now in the body's frame then.
        """
        hit = np.isfinite(ranges)
        own, turn = ranges[hit], angles[hit]
        seen = self.offset + np.stack([own * np.cos(turn), own * np.sin(turn)], axis=1)
        kept = self._kept(_seen_from(self.points, moved), np.isnan(ranges), angles)
        self.points = np.concatenate([seen, kept])

    def _kept(
        self, points: np.ndarray[Any, Any], unknown: np.ndarray[Any, Any],
        angles: np.ndarray[Any, Any],
    ) -> np.ndarray[Any, Any]:
        """Return the near ones of earlier points, in directions that are unknown now."""
        x, y = (points - self.offset).T
        is_near = np.hypot(x, y) < self.keep
        if not unknown.any() or not is_near.any():
            return points[:0]
        points, turn = points[is_near], np.arctan2(y, x)[is_near]
        ray = np.abs(_turns(turn[:, None] - angles)).argmin(axis=1)
        return np.asarray(points[unknown[ray]][-MOST_RAYS:])

    def blocked(
        self, v: float, omega: float, full: float, moved: tuple[float, float, float],
        extra: float = 0.0, turned: float = 0.0,
    ) -> bool:
        """
        Whether a command leads the body to something within its stopping distance.

        To this distance come the way of a control period and of the latency, two standard
        deviations of a range, and what was driven between the oldest ray and the stamp of the
        scan. What was turned while the scanner turned shifts the bearings of the points to both
        sides.

        Args:
            v: Speed.
            omega: Turn rate.
            full: Full speed, from which the stopping distance is measured.
            moved: Motion since the scan, as the pose now in the body's frame then.
            extra: Way from the oldest ray of the scan to its stamp.
            turned: Angle by which the robot turned in the time of the scan.
        """
        if abs(v) < 1e-6 or not len(self.points):
            return False
        points = _seen_from(self._shifted(turned), moved)
        far = self.stop * min(abs(v) / full, 1.0) + abs(v) * self.reaction
        far += self.error + extra
        away = np.hypot(*points.T)
        nearest = _from_arc(points, math.copysign(far, v), far * omega / abs(v))
        return bool(((nearest < self.radius) & (nearest < away - 1e-4)).any())

    def _shifted(self, turned: float) -> np.ndarray[Any, Any]:
        """Return the points on all bearings that they may have had, in steps of `BEARING`."""
        if abs(turned) < 1e-3:
            return self.points
        steps = math.ceil(abs(turned) / BEARING)
        each = np.linspace(-turned, turned, 2 * steps + 1)[:, None]
        x, y = self.points.T
        cosine, sine = np.cos(each), np.sin(each)
        return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1).reshape(-1, 2)


def _seen_from(
    points: np.ndarray[Any, Any], pose: tuple[float, float, float]
) -> np.ndarray[Any, Any]:
    """Return points, shape (n, 2), in the frame of a pose."""
    x, y, yaw = pose
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return np.asarray((points - (x, y)) @ np.array([[cosine, -sine], [sine, cosine]]))


def _from_arc(points: np.ndarray[Any, Any], way: float, turn: float) -> np.ndarray[Any, Any]:
    """
    Distances of points, shape (n, 2), from an arc that begins at the origin along x.

    Args:
        points: The points.
        way: Length of the arc; below 0 it leads backwards.
        turn: Change of the heading along it.
    """
    x, y = points.T
    if abs(turn) < 1e-6:
        return np.asarray(np.hypot(x - np.clip(x, min(way, 0.0), max(way, 0.0)), y))
    radius = way / turn  # of a circle around (0, radius); signed
    end = radius * math.sin(turn), radius * (1.0 - math.cos(turn))
    away = np.minimum(np.hypot(x, y), np.hypot(x - end[0], y - end[1]))
    # How far along the circle a point lies, in the direction of the arc.
    along = np.arctan2(x / radius, 1.0 - y / radius) * math.copysign(1.0, turn) % math.tau
    ring = np.abs(np.hypot(x, y - radius) - abs(radius))
    return np.asarray(np.where(along < abs(turn), ring, away))


def _turns(angle: Any) -> Any:
    """Return angles in (-pi, pi]."""
    return math.pi - (math.pi - angle) % math.tau


def _filled(found: np.ndarray[Any, Any], lost: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Fill lost rays with the nearer one of the next values on both sides."""
    if not lost.any():
        return found
    known, count = np.flatnonzero(~lost), len(found)
    for i in np.flatnonzero(lost):
        away = (known - i) % count
        found[i] = min(found[known[away.argmin()]], found[known[away.argmax()]])
    return found
