"""What a drive was verified with, and what the user declares."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Any

PERIODS = 3
"""Control periods after which a scan or a pose is too old."""
LATENCY = 1
"""Control periods from a command to the wheels that are reckoned with; more is not covered."""
SHARE = 0.5
"""Share of a control period in which the node waits for an answer."""
LOST = 2.0
"""Time without fitting data after which the robot stands until it is started again, s."""
FARTHEST = 1e6
"""No place on a map is so far away, m."""


class SettingsError(ValueError):
    """What the package, the robot or the launch file says cannot be driven with."""


@dataclass(frozen=True)
class Settings:
    """
    What the controller was verified with, and what the user declares.

    Attributes:
        dt: Control period.
        horizon: Commands after which the drive ends without the goal.
        start: Verified start: x, y, yaw.
        goal: x, y.
        goal_tolerance: Distance at which the goal counts as reached.
        robot: See `settings.json`.
        dead_man: Time after which the robot stops by itself without a command.
        max_age: Largest age of a scan and of a pose; 0 for three periods.
        max_jump: Largest distance of a pose from where the commands lead; 0 for the radius.
        max_localiser_age: Largest time without a new transform of the localiser.
        max_deviation: Largest standard deviation of x and of y, as the localiser says; 0 for
            `usual_deviation`.
        max_speed: Largest speed of the body, such as for a first drive; 0 for that of the
            robot.
        resample_scan: Whether a robot with a scanner takes scans with another number of rays.
        any_start: Whether to drive from a start that no verified drive had.
        start_on: When the drive begins: `pose`, as soon as the data fit, or `service`, when
            `Core.start` is called.
        any_map: Whether the localiser may have another map than the controller.
        recover: Whether to drive on by itself after a stop that otherwise lasts until `Core.start`
            is called again.
        own_map: Size, resolution and origin of the controller's map; see `motion.other_map`.
            None compares none.
    """

    dt: float
    horizon: int
    start: tuple[float, float, float]
    goal: tuple[float, float]
    goal_tolerance: float
    robot: dict[str, Any]
    dead_man: float
    max_age: float = 0.0
    max_jump: float = 0.0
    max_localiser_age: float = 1.0
    max_deviation: float = 0.0
    max_speed: float = 0.0
    resample_scan: bool = False
    any_start: bool = False
    start_on: str = 'pose'
    any_map: bool = False
    recover: bool = False
    own_map: dict[str, Any] | None = None

    def __post_init__(self) -> None:
        for name in ('dt', 'horizon', 'goal_tolerance'):
            if not 0.0 < getattr(self, name) < math.inf:
                raise SettingsError(f'{name}: expected above 0, got {getattr(self, name)!r}')
        if not sum(map(abs, (*self.start, *self.goal))) < FARTHEST:
            raise SettingsError(f'expected numbers, got start {self.start}, goal {self.goal}')
        limit = PERIODS * self.dt
        if not 0.0 < self.dead_man <= limit + 1e-9:
            raise SettingsError(
                f'dead_man: expected the seconds after which the robot stops by itself without '
                f'a command, above 0 and at most {limit:g} (three periods), got '
                f'{self.dead_man:g}; without such a timer the robot must not be driven')
        if not 0.0 <= self.max_age <= limit + 1e-9:
            raise SettingsError(
                f'max_age: expected at most {limit:g} s (three periods), got {self.max_age:g}')
        if not self.dt <= self.max_localiser_age <= LOST:
            raise SettingsError(
                f'max_localiser_age: expected {self.dt:g} to {LOST:g} s, got '
                f'{self.max_localiser_age:g}')
        for name in ('max_jump', 'max_deviation', 'max_speed'):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise SettingsError(f'{name}: expected 0 or more, got {getattr(self, name):g}')
        if self.start_on not in ('pose', 'service'):
            raise SettingsError(f'start_on: expected pose or service, got {self.start_on!r}')
        for name in ('radius', 'axle_length', 'max_wheel_speed', 'stopping_distance'):
            value = self.robot.get(name)
            if not isinstance(value, (int, float)) or not 0.0 < value < math.inf:
                raise SettingsError(f'robot: expected {name} above 0, got {value!r}')

    @property
    def oldest(self) -> float:
        """Largest age of a scan and of a pose."""
        return self.max_age or PERIODS * self.dt

    @property
    def largest_jump(self) -> float:
        """Largest distance of a pose from where the commands lead."""
        return self.max_jump or float(self.robot['radius'])

    @property
    def largest_deviation(self) -> float:
        """Largest standard deviation of x and of y, as the localiser says."""
        return self.max_deviation or usual_deviation(self.robot)

    @property
    def full_speed(self) -> float:
        """Largest speed of the body."""
        robot = self.robot
        return float(min(robot['max_wheel_speed'], robot.get('max_speed') or math.inf))

    @property
    def latency(self) -> float:
        """Longest time from a command to the wheels that is reckoned with."""
        return LATENCY * self.dt

    @property
    def reaction(self) -> float:
        """Longest time for which the robot obeys a command, once a later one stops it."""
        return self.dt + self.latency

    def stops_within(self) -> dict[str, float]:
        """Distance to standstill, from full speed, by what happens."""
        v = self.full_speed
        own = float(self.robot['stopping_distance']) + v * self.reaction
        return {
            'a scan or a pose is late, lost or old': v * self.oldest + own,
            'the localiser is silent': v * (self.max_localiser_age + self.dt) + own,
            'the pose jumps or is unsure': own,
            'the controller is late, raises or is not finite': own,
            'something is ahead, the goal, /drive/stop, SIGTERM, a second publisher': own,
            'the node is killed, frozen or unreachable': v * self.dead_man + own,
        }


def usual_deviation(robot: dict[str, Any]) -> float:
    """
    Return the largest standard deviation of x and of y that a localiser may state.

    Three times the noise of the pose in the verification, and at most the radius of the body; the
    radius if the pose had no noise.
    """
    radius, noise = float(robot['radius']), float(robot.get('pose_noise') or 0.0)
    return min(3.0 * noise, radius) if noise else radius
