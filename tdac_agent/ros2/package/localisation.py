"""Where the robot is, and whether it can be believed: jumps, silence, motion as commanded."""

from __future__ import annotations

from collections import deque
import math

from .motion import compose, Driven, wrapped
from .settings import LOST, PERIODS, Settings

STEADY = 10
"""Control periods without a jump after which the pose counts again."""
TURNED = 0.25
"""Largest jump and standard deviation of the yaw, rad."""
STUCK = 0.25
"""Smallest share of the commanded way that a robot drives, unless it is stuck."""

Pose = tuple[float, float, float]


class Localisation:
    """
    The last pose, and why it may not be driven with.

    Attributes:
        pose: The last pose in the map's frame.
        stamp: Its time.
        strays: How the robot moved otherwise than it was told to; empty if it did not.

    Args:
        settings: See there.
        driven: The motion by the commands.
    """

    def __init__(self, settings: Settings, driven: Driven) -> None:
        self._settings, self._driven = settings, driven
        self.pose: Pose = (0.0, 0.0, 0.0)
        self.stamp = -math.inf
        self.strays = ''
        self._jump, self._jump_stamp, self._unsure = '', -math.inf, ''
        self._transform: float | None = None
        self._renewed = math.inf
        self._past: deque[tuple[float, Pose]] = deque(maxlen=1000)

    def take(self, stamp: float, pose: Pose) -> None:
        """Take a newer pose than the last one."""
        if self.stamp > -math.inf:
            off, turn = self._off(stamp, pose)
            if off > self._settings.largest_jump or turn > TURNED:
                self._jump = f'the pose jumped by {off:.2f} m and {turn:.2f} rad'
                self._jump_stamp = stamp
                self._past.clear()
        if stamp < self.stamp:  # the last one was of no such time
            self._past.clear()
        self.pose, self.stamp = pose, stamp
        self._compare_way()

    def take_transform(self, stamp: float) -> None:
        """
        Take the stamp of the localiser's transform, which shows that it is alive if it is new.

        A localiser may stamp ahead of its data, as AMCL does by its `transform_tolerance`, so only
        the time counts in which the stamp does not change.
        """
        if stamp != self._transform and math.isfinite(stamp):
            self._transform, self._renewed = stamp, math.inf  # the next `tick` says when

    def take_variances(self, variances: tuple[float, float, float]) -> None:
        """Take the variances of x, y and yaw that a localiser states; 0 or less says nothing."""
        x, y, yaw = (math.inf if math.isnan(each) else each for each in variances)
        off, turn = math.sqrt(max(x, y, 0.0)), math.sqrt(max(yaw, 0.0))
        self._unsure, most = '', self._settings.largest_deviation
        if off > most or turn > TURNED:
            self._unsure = (
                f'the pose is unsure: standard deviation {off:.2f} m and {turn:.2f} rad, at '
                f'most {most:g} m and {TURNED:g} rad (max_deviation)')

    def tick(self, now: float) -> None:
        """Take the time of a control period."""
        self._renewed = min(self._renewed, now)

    def begin(self) -> None:
        """Forget how the robot moved."""
        self.strays = ''
        self._past.clear()

    def unfit(self, now: float) -> str:
        """Return why the pose may not be driven with, whatever its age; or an empty text."""
        silent = self._settings.max_localiser_age
        if self._transform is not None and not now - self._renewed <= silent + 1e-9:
            return f'the localiser sent nothing new for {silent:g} s (max_localiser_age)'
        if self._unsure:
            return self._unsure
        if self.has_jumped():
            return f'{self._jump}: it must be steady for {STEADY * self._settings.dt:g} s'
        return ''

    def has_jumped(self) -> bool:
        """Return whether the pose jumped and has not been steady since."""
        return self.stamp - self._jump_stamp < STEADY * self._settings.dt

    def is_sure(self) -> bool:
        """Return whether the pose is that of the robot, as far as can be known."""
        return not self._unsure and not self.has_jumped()

    def _off(self, stamp: float, pose: Pose) -> tuple[float, float]:
        """
        Return how far a pose is from where the commands lead since the last one: m, rad.

        The wheels may have obeyed up to three periods late; the best fit counts.
        """
        found = []
        for late in range(PERIODS + 1):
            shift = late * self._settings.dt
            moved = self._driven.between(self.stamp - shift, stamp - shift)
            there = compose(self.pose, moved)
            turn = abs(wrapped(pose[2] - there[2]))
            found.append((math.dist(pose[:2], there[:2]), turn))
        limit = self._settings.largest_jump
        return min(found, key=lambda each: max(each[0] / limit, each[1] / TURNED))

    def _compare_way(self) -> None:
        """Compare the way of the last `LOST` seconds with the commanded one."""
        while len(self._past) > 1 and self._past[1][0] <= self.stamp - LOST:
            self._past.popleft()
        self._past.append((self.stamp, self.pose))
        since, before = self._past[0]
        if not LOST - 1e-6 <= self.stamp - since <= 1.5 * LOST:  # poses were missing
            return
        late = self._settings.reaction
        wanted = math.hypot(*self._driven.between(since - late, self.stamp - late)[:2])
        way, radius = math.dist(before[:2], self.pose[:2]), float(self._settings.robot['radius'])
        told = f'it moved {way:.2f} m in {LOST:g} s, the commands say {wanted:.2f} m'
        if wanted > radius and way < STUCK * wanted:
            self.strays = f'the robot is stuck: {told}'
        elif way > radius and wanted < STUCK * way:
            self.strays = f'the robot moves by itself: {told}'
