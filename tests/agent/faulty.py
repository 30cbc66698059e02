"""Policies with a fault that is planted, for the real environment."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from tdac_envs.grid.grid import clearance
from tdac_envs.grid.plan import plan_path
from tdac_envs.map2d.task import Map2DTask

Act = Callable[[dict[str, Any]], tuple[float, float]]
Fault = Callable[[Map2DTask], Act]


class Follower:
    """Plans a path and pursues it: sound, until a fault is planted.

    Args:
        task: Any.
        goal: Where it believes the goal to be.
        margin: Room that the plan keeps beside the body, px.
        lookahead: px.
        speed: Fraction of the wheel limit.
        gain: Wheel difference for a heading error of 1 rad.
        pivot: Heading error from which it turns in place, rad.
        stop: Distance to its goal at which it stands, px.
        heading: What it takes its heading for.
        wheels: What it makes of (left, right).
    """

    def __init__(
        self,
        task: Map2DTask,
        *,
        goal: tuple[float, float] | None = None,
        margin: float = 7.0,
        lookahead: float = 12.0,
        speed: float = 1.0,
        gain: float = 3.0,
        pivot: float = 0.6,
        stop: float = 0.0,
        heading: Callable[[float], float] = lambda heading: heading,
        wheels: Callable[[float, float], tuple[float, float]] = lambda *wheels: wheels,
    ) -> None:
        self.goal = goal or task.goal
        self.cells = task.terrain.grid.cells
        self.room = task.robot.radius + margin
        self.path: np.ndarray | None = None
        self.near = 0
        self.lookahead, self.speed, self.gain = lookahead, speed, gain
        self.pivot, self.stop = pivot, stop
        self.heading, self.wheels = heading, wheels

    def __call__(self, obs: dict[str, Any]) -> tuple[float, float]:
        x, y, heading = (float(value) for value in obs["pose"])
        if math.dist((x, y), self.goal) < self.stop:
            return 0.0, 0.0
        to_x, to_y = self.target(x, y)
        if math.dist((x, y), (to_x, to_y)) < 1.0:
            return 0.0, 0.0
        error = math.atan2(to_y - y, to_x - x) - self.heading(heading)
        error = math.remainder(error, 2.0 * math.pi)
        speed = self.speed if abs(error) < self.pivot else 0.0
        turn = max(min(self.gain * error, 1.0), -1.0) * self.speed
        left, right = self.wheels(speed + turn, speed - turn)
        over = max(abs(left), abs(right), 1.0)
        return left / over, right / over

    def target(self, x: float, y: float) -> tuple[float, float]:
        """The point of the path to drive to."""
        if self.path is None:
            self.path = self.plan(x, y)
        part = self.path[self.near : self.near + 100]
        off = np.hypot(part[:, 0] - x, part[:, 1] - y)
        nearest = int(off.argmin())
        ahead = off[nearest:] >= self.lookahead
        index = nearest + int(ahead.argmax()) if ahead.any() else len(part) - 1
        self.near += nearest
        return float(part[index, 0]), float(part[index, 1])

    def plan(self, x: float, y: float) -> np.ndarray:
        """A path that keeps its room, or less where the ends have none."""
        clear = clearance(self.cells)
        ends = (round(x), round(y)), (round(self.goal[0]), round(self.goal[1]))
        for room in np.arange(self.room, 0.0, -0.5):
            free = clear > room
            path = plan_path(free, *ends)
            if len(path):
                return path
        return np.array(ends, float)


def follower(**faults: Any) -> Fault:
    return lambda task: Follower(task, **faults)


def always(left: float, right: float) -> Fault:
    return lambda task: lambda obs: (left, right)


def repeat(*blocks: tuple[int, float, float]) -> Fault:
    """Repeats (steps, left, right) for ever."""

    def plant(task: Map2DTask) -> Act:
        once = [block[1:] for block in blocks for _ in range(block[0])]
        turn = itertools.cycle(once)
        return lambda obs: next(turn)

    return plant


def switch(
    steps: int,
    before: Fault,
    after: Fault,
) -> Fault:
    """One policy for some steps, then another."""

    def plant(task: Map2DTask) -> Act:
        first, then, count = before(task), after(task), itertools.count()

        def act(obs: dict[str, Any]) -> tuple[float, float]:
            return first(obs) if next(count) < steps else then(obs)

        return act

    return plant


def patrol(*places: tuple[float, float], near: float = 8.0) -> Fault:
    """Drives from place to place in straight lines, for ever."""

    def plant(task: Map2DTask) -> Act:
        left = list(places)

        def act(obs: dict[str, Any]) -> tuple[float, float]:
            x, y, heading = (float(value) for value in obs["pose"])
            if math.dist((x, y), left[0]) < near:
                left.append(left.pop(0))
            bearing = math.atan2(left[0][1] - y, left[0][0] - x)
            error = math.remainder(bearing - heading, 2.0 * math.pi)
            if abs(error) > 0.3:
                return math.copysign(0.8, error), -math.copysign(0.8, error)
            return 0.9 + 0.5 * error, 0.9 - 0.5 * error

        return act

    return plant


def shuttle(there: tuple[float, float], back: tuple[float, float]) -> Fault:
    """Plans to one place, then to the other, for ever."""

    def plant(task: Map2DTask) -> Act:
        ends = itertools.cycle([there, back])
        way = Follower(task, goal=next(ends))

        def act(obs: dict[str, Any]) -> tuple[float, float]:
            nonlocal way
            x, y, _ = (float(value) for value in obs["pose"])
            if math.dist((x, y), way.goal) < 8.0:
                way = Follower(task, goal=next(ends))
            return way(obs)

        return act

    return plant


def brake(at: float, back: float = 0.0) -> Fault:
    """Straight on until a ray reads less than `at` px, then at another speed."""

    def plant(task: Map2DTask) -> Act:
        return lambda obs: (back, back) if min(obs["ranges"]) < at else (0.6, 0.6)

    return plant


def ease(gap: float) -> Fault:
    """Straight to the goal, the slower the nearer a wall is ahead."""

    def plant(task: Map2DTask) -> Act:
        def act(obs: dict[str, Any]) -> tuple[float, float]:
            ahead = float(min(obs["ranges"][6:12])) - gap
            speed = max(min(ahead / 60.0, 0.8), 0.0)
            x, y, heading = (float(value) for value in obs["pose"])
            bearing = math.atan2(obs["goal"][1] - y, obs["goal"][0] - x)
            error = math.remainder(bearing - heading, 2.0 * math.pi)
            return speed + 0.3 * error, speed - 0.3 * error

        return act

    return plant


def hug(gap: float, hand: float, speed: float = 0.5) -> Fault:
    """Follows the wall on one hand (-1 left, 1 right) at a distance, by its rays."""

    def plant(task: Map2DTask) -> Act:
        found = False

        def act(obs: dict[str, Any]) -> tuple[float, float]:
            nonlocal found
            rays = obs["ranges"][::-1] if hand > 0 else obs["ranges"]
            ahead, beside = float(min(rays[5:13])), float(min(rays[:4]))
            found = found or min(ahead, beside) < gap + 12.0
            if ahead < gap + 12.0:
                return -0.4 * hand, 0.4 * hand
            turn = max(min((beside - 1.22 * gap) / 20.0, 0.3), -0.6)
            turn = hand * turn if found else 0.0
            return speed * (1.0 + turn), speed * (1.0 - turn)

        return act

    return plant


def seeded_twitch(task: Map2DTask) -> Act:
    """Small random wheel speeds, now and again."""
    random = np.random.default_rng(3)

    def act(obs: dict[str, Any]) -> tuple[float, float]:
        if random.random() < 0.9:
            return 0.0, 0.0
        left, right = random.uniform(-0.05, 0.05, 2)
        return float(left), float(right)

    return act


def orbit(radius: float) -> Fault:
    """Follows its path, and near the goal drives around it."""

    def plant(task: Map2DTask) -> Act:
        way = Follower(task)

        def act(obs: dict[str, Any]) -> tuple[float, float]:
            x, y, heading = (float(value) for value in obs["pose"])
            distance = math.dist((x, y), task.goal)
            if distance > radius + 20.0:
                return way(obs)
            bearing = math.atan2(task.goal[1] - y, task.goal[0] - x)
            inward = max(min((distance - radius) / 20.0, 1.0), -1.0)
            wanted = bearing + math.pi / 2 * (1.0 - inward)
            error = math.remainder(wanted - heading, 2.0 * math.pi)
            turn = max(min(1.5 * error, 0.5), -0.5)
            return 0.5 + turn, 0.5 - turn

        return act

    return plant


def seldom(period: int, policy: Fault) -> Fault:
    """Moves in one step of several."""

    def plant(task: Map2DTask) -> Act:
        inner, count = policy(task), itertools.count()
        return lambda obs: inner(obs) if next(count) % period == 0 else (0.0, 0.0)

    return plant


def swapped(left: float, right: float) -> tuple[float, float]:
    return right, left
