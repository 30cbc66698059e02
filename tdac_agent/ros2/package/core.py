"""
Drive a robot with a verified controller: everything but ROS.

Lengths are in metres of the map's frame, angles in radians and counter-clockwise, times in
seconds of one clock, that of the stamps. The node calls `Core.scan` and `Core.pose` with what
arrives, and `Core.tick` once per control period; it publishes what `tick` returns.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
import math
from typing import Any, Protocol

import numpy as np

from .localisation import Localisation
from .motion import compose, Driven, other_map, unfit_stamp, unheard, Wheels, wrapped
from .scans import Guard, Layout, LayoutError, Scanner
from .settings import FARTHEST, LOST, PERIODS, Settings, SettingsError, SHARE

__all__ = ['PERIODS', 'SHARE', 'Command', 'Core', 'Policy', 'Settings', 'SettingsError']
RECENT = 20
"""Number of the last control periods in which most answers must not be late."""
SETTLED = 1.0
"""Time after the last motion in which the robot has come to a stand, s."""
FORGOTTEN = 5.0
"""Time from the call of `start` after which the first plan needs another call, s."""
MOST_TURNED = 0.5
"""Turn from a place within which the robot counts as there, as a verified start has it, rad."""
AGAIN = 'call the service start to drive on'


class Policy(Protocol):
    """A controller that works beside the node, such as `worker.Worker`."""

    def ask(self, observation: dict[str, Any]) -> None:
        """Begin with an answer; the first one includes planning."""

    def answer(self, wait: float) -> tuple[str, Any] | None:
        """Return ('action', (left, right)) or ('error', text); None if there is none yet."""


@dataclass(frozen=True)
class Command:
    """
    A command, and why it is what it is.

    Attributes:
        v: Speed, m/s.
        omega: Turn rate, rad/s.
        state: waiting, planning, driving, stopped, reached, failed or ended.
        reason: Why the robot stands; empty when it drives.
    """

    v: float
    omega: float
    state: str
    reason: str = ''


class Core:
    """
    The state of a drive: what has arrived, what the controller said, what is safe.

    Attributes:
        publishers: How many publishers the topic of commands has, this one included.
        listeners: How many take the commands.
        timer_unfit: Why the robot's own timer is not known to work; empty if it is.
        commands: Answers of the controller so far.
        latched: Why the robot stands until `start` is called; empty if it does not.
        final: The last command, when the drive is over.
    """

    def __init__(self, settings: Settings, policy: Policy) -> None:
        self.settings, self._policy = settings, policy
        slow = {'max_speed': min(settings.max_speed, settings.full_speed)}
        own = settings.robot | slow if settings.max_speed else settings.robot
        self._wheels = Wheels(own, settings.dt)
        self._scanner = Scanner(settings.robot, settings.resample_scan)
        self._guard = Guard(settings.robot, settings.reaction)
        self._scan_age = 0.0
        self._ranges: np.ndarray[Any, Any] | None = None
        self._scan_stamp = -math.inf
        self._driven = Driven(settings.dead_man)
        self.where = Localisation(settings, self._driven)
        self._place = self.where.pose
        self._drove_at = self._called_at = -math.inf
        self._refused = ''
        self._now = -math.inf
        self._asked = self._planned = self._begun = False
        self._held = settings.start_on == 'service'
        self._fit = math.inf
        self._late: deque[bool] = deque(maxlen=RECENT)
        self.latched = ''
        self.publishers = self.listeners = 1
        self.timer_unfit = ''
        self.commands = 0
        self.final: Command | None = None

    def scan(self, stamp: float, layout: Layout, ranges: Any, age: float = 0.0) -> None:
        """
        Take a scan; older ones than the last, and ones without values, do not count.

        Args:
            stamp: Its time.
            layout: Its header.
            ranges: Its ranges.
            age: How much older than the stamp its oldest ray may be; see `scans.oldest_ray`.
                0, as where a header says no times, counts as a control period.
        """
        if self.final is not None or not self._is_new(stamp, self._scan_stamp):
            return
        try:
            self._scanner.use(layout)
        except LayoutError as error:
            self.refuse_scan(str(error))
            if not self.settings.resample_scan:  # the next scan may have another header
                self._end('failed', str(error))
            return
        task, guard = self._scanner.read(ranges)
        if task is not None:
            moved = self._driven.between(self._scan_stamp, stamp)
            self._ranges, self._scan_stamp, self._refused = task, stamp, ''
            self._scan_age = age or self.settings.dt
            self._guard.see(guard, self._scanner.guard_angles(), moved)

    def refuse_scan(self, why: str) -> None:
        """Say why scans do not count."""
        self._refused = f': {why}'

    def pose(self, stamp: float, x: float, y: float, yaw: float) -> None:
        """Take a pose in the map's frame; older ones than the last do not count."""
        if not abs(x) + abs(y) + abs(yaw) < FARTHEST:
            return
        if not self._is_new(stamp, self.where.stamp):
            return
        pose = (x, y, wrapped(yaw))
        self.where.take(stamp, pose)
        if stamp <= self._drove_at + SETTLED:
            self._place = pose

    def localiser_map(
        self, size: tuple[int, int], resolution: float, origin: tuple[float, float, float]
    ) -> None:
        """End the drive if the localiser has another map than the controller."""
        own = self.settings.own_map
        if own is None or self.settings.any_map or self.final is not None:
            return
        if why := other_map(own, size, resolution, origin):
            self._end('failed', why)

    def has(self, stamp: float) -> bool:
        """Whether scan and pose of this moment have arrived."""
        return min(self._scan_stamp, self.where.stamp) >= stamp - 1e-6

    def end(self, reason: str) -> Command:
        """End the drive, as on SIGTERM."""
        return self.final or self._end('ended', reason)

    def start(self, now: float) -> tuple[bool, str]:
        """Begin the drive, if all fits now; return whether it does, and what to say."""
        now = self._time(now)
        if self.final is not None:
            return False, f'{self.final.state}: {self.final.reason}'
        if not self._held and not self.latched:
            return True, 'the drive has begun'
        if why := self._unfit(now) or self._was_moved():
            return False, why
        said = 'the drive goes on' if self._begun else 'the drive begins'
        self._held, self.latched, self._fit = False, '', now
        self._called_at = now
        self.where.begin()
        self._late.clear()
        return True, said

    def stop(self, reason: str = 'the service stop was called') -> str:
        """Stand from the next period on, until `start` is called; return the state."""
        if self.final is not None:
            return f'{self.final.state}: {self.final.reason}'
        self.latched = reason
        return f'stopped: {reason}; {AGAIN}'

    def check_timer(self, name: str, values: list[float | None]) -> None:
        """End the drive if the robot's timer, as its driver says, is missing or too long."""
        limit = self.settings.dead_man
        value = values[0] if values else None
        if value is None or not 0.0 < value <= limit + 1e-9:
            got = 'no number' if value is None else f'{value:g}'
            why = f'{name}: expected above 0 and at most dead_man, {limit:g} s, got {got}'
            self._end('failed', why)

    def drove(self, v: float, omega: float) -> None:
        """Take another command than the last one as driven, as in a recorded drive."""
        self._wheels.last = self._wheels.fractions(v, omega)
        self._driven.change(v, omega)

    def tick(self, now: float, wait: float) -> Command:
        """
        Return the command of a control period.

        Args:
            now: Time. If it goes back by more than a period, as when a simulation begins
                again, the drive ends.
            wait: How long the controller may take for an answer, wall-clock seconds.
        """
        now = self._time(now)
        command = self._next(now, wait)
        self._driven.take(now, command.v, command.omega)
        return command

    def _time(self, now: float) -> float:
        """Return the time, which never goes back."""
        back = self._now - now
        if back > self.settings.dt and self.final is None:
            self._end('failed', f'the clock went back by {back:.3g} s: start the node again')
        self._now = max(self._now, now)
        return self._now

    def _is_new(self, stamp: float, last: float) -> bool:
        """Return whether data are newer than the last ones, or those were of no such time."""
        return stamp > last or math.inf > last - self._now > self.settings.oldest

    def _next(self, now: float, wait: float) -> Command:
        if self.final is not None:
            return self.final
        self.where.tick(now)
        why = self._unfit(now)
        if self._begun and self._is_at_goal(now):
            return self._end('reached', 'the goal')
        self._latch(why, now)
        if self.latched:
            why = f'{self.latched}; {AGAIN}'
        return self._waited(why, now) or self._ask(why, now, wait)

    def _waited(self, why: str, now: float) -> Command | None:
        """Return the command while an answer is due, or with the first plan; else None."""
        if not self._asked:
            return None
        answer = self._policy.answer(0.0)
        if answer is None or not self._planned or answer[0] == 'error':
            return self._take(answer, why, now)
        self._asked = False  # a late answer, to an observation that is old
        return None

    def _ask(self, why: str, now: float, wait: float) -> Command:
        """Return the command of this period, if it may be one of motion."""
        if why or self._held:
            if not self._planned and self.settings.start_on == 'service':
                self._held = True  # the call was for then, not for whenever it fits
            why = why or 'ready: call the service start'
            return self._stand('stopped' if self._begun else 'waiting', why)
        if self._is_at_goal(now):
            return self._end('reached', 'the goal')
        if self.commands >= self.settings.horizon:
            return self._end('failed', f'not at the goal after {self.commands} commands')
        self._policy.ask(self.observation())
        self._asked = True
        return self._take(self._policy.answer(wait), '', now)

    def _is_at_goal(self, now: float) -> bool:
        """Return whether the last pose that counted is at the goal, even if it is old by now."""
        ahead = self.where.stamp - now
        if not self.where.is_sure() or ahead > self.settings.oldest:
            return False
        return math.dist(self.where.pose[:2], self.settings.goal) <= self.settings.goal_tolerance

    def _latch(self, why: str, now: float) -> None:
        """Stop for good, until `start` is called, where a person may be near by now."""
        missing = now - self._fit
        if not why or not self._is_underway():
            self._fit = now
        if self.settings.recover or self.latched or not self._is_underway():
            return
        is_alone = self.publishers <= 1 and self.listeners and not self.timer_unfit
        if not is_alone or self.where.has_jumped():
            self.latched = why
        elif self.where.strays and self._begun:
            self.latched = self.where.strays
        elif missing > LOST:
            reason = why or 'the data are back'
            self.latched = f'without fitting data for more than {LOST:g} s: {reason}'

    def _is_underway(self) -> bool:
        """Return whether the drive was begun, by a call or by a first motion."""
        by_call = self.settings.start_on == 'service' and self._asked and not self._held
        return self._begun or by_call

    def _was_late(self, *, late: bool) -> None:
        self._late.append(late)
        if self.settings.recover or self.latched or 2 * sum(self._late) <= RECENT:
            return
        self.latched = f'the controller was late in most of the last {RECENT} control periods'

    def _take(self, answer: tuple[str, Any] | None, why: str, now: float) -> Command:
        """Return the command of an answer; None if there is none yet."""
        if answer is None:
            if self._planned:
                self._was_late(late=True)
                return self._stand('stopped', why or 'the controller is late')
            return self._stand('planning', 'the first plan is not ready')
        is_first = not self._planned
        self._asked, self._planned = False, True
        if answer[0] == 'error':
            return self._end('failed', str(answer[1]))
        if is_first and self.settings.start_on == 'service' and now > self._called_at + FORGOTTEN:
            self._held = True
            return self._stand('waiting', 'the plan is ready: call the service start again')
        if why:
            return self._stand('stopped', why)
        self._was_late(late=False)
        return self._drive(answer[1], now)

    def observation(self) -> dict[str, Any]:
        """Return what the controller observes, as it did when it was verified."""
        own = {
            'pose': self.where.pose, 'goal': self.settings.goal, 'wheel_speeds': self._wheels.last,
            'ranges': self._ranges}
        return {name: np.array(value, np.float32) for name, value in own.items()}

    def _drive(self, action: Any, now: float) -> Command:
        left, right = action
        self.commands += 1
        last = self._wheels.last
        v, omega = self._wheels.twist(*self._wheels.limited(left, right))
        stamp, age = self._scan_stamp, self._scan_age
        before, after, rest = self._driven.parts(stamp - age, stamp, min(stamp + age, now), now)
        moved, turned = compose(after, rest), max(abs(before[2]), abs(after[2]))
        extra = math.hypot(*before[:2])
        if self._guard.blocked(v, omega, self.settings.full_speed, moved, extra, turned):
            self._wheels.last = last
            return self._stand('stopped', 'something is ahead within the stopping distance')
        self._begun, self._drove_at = True, now
        self._place = compose(self.where.pose, self._driven.between(self.where.stamp, now))
        return Command(v, omega, 'driving')

    def _unfit(self, now: float) -> str:
        """Return why no command may move the robot now; an empty text if one may."""
        if why := unheard(self.publishers, self.listeners) or self.timer_unfit:
            return why
        oldest = self.settings.oldest
        for name, stamp in (('scan', self._scan_stamp), ('pose', self.where.stamp)):
            if why := unfit_stamp(name, now - stamp, oldest):
                return why + (self._refused if name == 'scan' else '')
        if abs(self._scan_stamp - self.where.stamp) > oldest:
            return f'scan and pose are more than {oldest:g} s apart'
        if why := self.where.unfit(now):
            return why
        may_begin = self._begun or self.settings.any_start
        return '' if may_begin else self._wrong_start()

    def _wrong_start(self) -> str:
        if not (apart := self._apart_from(self.settings.start)):
            return ''
        x, y, yaw = self.settings.start
        radius = float(self.settings.robot['radius'])
        return (
            f'the robot stands {apart} from the verified start ({x:g}, {y:g}, {yaw:g}); at most '
            f'{radius:g} m and {MOST_TURNED:g} rad are covered (any_start)')

    def _was_moved(self) -> str:
        """Return why a drive cannot go on from where the robot stands, or an empty text."""
        if not self._begun or self.settings.any_start:
            return ''
        if not (apart := self._apart_from(self._place)):
            return ''
        x, y, yaw = self._place
        return (
            f'the robot stands {apart} from where it came to a stand ({x:.2f}, {y:.2f}, '
            f'{yaw:.2f}): put it back there, or start the node again at the start (any_start)')

    def _apart_from(self, place: tuple[float, float, float]) -> str:
        """Return how far the robot is from a place, or nothing if it counts as there."""
        own = self.where.pose
        off, turn = math.dist(own[:2], place[:2]), abs(wrapped(own[2] - place[2]))
        is_there = off <= float(self.settings.robot['radius']) and turn <= MOST_TURNED
        return '' if is_there else f'{off:.2f} m and {turn:.2f} rad'

    def _stand(self, state: str, reason: str) -> Command:
        self._wheels.limited(0.0, 0.0)
        return Command(0.0, 0.0, state, reason)

    def _end(self, state: str, reason: str) -> Command:
        self.final = Command(0.0, 0.0, state, reason)
        return self.final
