"""The movers of an environment, and where they are at the start of an episode."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.errors import TaskError
from tdac_envs.drive.task import MAX_DRAWS, check_full_step
from tdac_envs.map2d.encounters import LOOK, nearest_approaches
from tdac_envs.map2d.starts import KINDS, Person, Point, Random, Start
from tdac_envs.movers import state as at
from tdac_envs.movers.crowd import WALL_HORIZON
from tdac_envs.movers.destinations import Destinations, destinations_of
from tdac_envs.movers.spec import AnySpec, CrowdSpec
from tdac_envs.movers.state import Movers

if TYPE_CHECKING:
    from tdac_envs.map2d.task import Map2DTask

SAFE_SECONDS = 2.0
"""No mover touches a robot that stands at its start for this time."""


@dataclass(frozen=True, slots=True, eq=False)
class MoversSetup:
    """The movers of an environment on a map; their starts are drawn per episode.

    Attributes:
        starts: Where each mover starts.
        traits: `Movers.traits`.
        points: `Movers.points`.
        destinations: Where people walk; None without a crowd.
        seeing: Of each mover, whether a person sees the robot; None if drawn.
    """

    starts: tuple[Start, ...]
    traits: NDArray[np.float64]
    points: NDArray[np.float64]
    destinations: Destinations | None
    seeing: tuple[bool | None, ...]

    @classmethod
    def of(cls, specs: Sequence[AnySpec], task: Map2DTask) -> MoversSetup:
        """The movers that a user asks for, checked on the map of a task.

        Args:
            specs: From `movers.spec.read_specs`.
            task: The task; its start, goal and movers are ignored.

        Raises:
            TaskError: A route runs into a wall, or a disc fits nowhere; the message
                names the mover.
        """
        each = [spec for spec in specs for _ in range(spec.number)]
        starts: list[Start] = []
        points: list[Point] = []
        traits = np.zeros((len(each), at.N_TRAITS))
        destinations = _destinations(specs, task)
        for m, spec in enumerate(each):
            radius, speed = _size_of(spec, task)
            check_full_step(max(task.dt, LOOK), speed, "px")
            try:
                own = (
                    Person(destinations.nodes(), len(destinations.fields))
                    if destinations and isinstance(spec, CrowdSpec)
                    else KINDS[spec.kind](spec, task, radius, speed)
                )
            except TaskError as error:
                raise TaskError(f"mover {m}: {error}") from None
            traits[m] = own.kind, radius, speed, len(points), len(own.points)
            points += own.points
            starts.append(own)
        seeing = tuple(getattr(spec, "sees_robot", None) for spec in each)
        return cls(
            tuple(starts), traits, np.array(points).reshape(-1, 2), destinations, seeing
        )

    def start(self, task: Map2DTask, random: Random) -> Movers:
        """Draws the movers of an episode at its start.

        Args:
            task: The task; its movers are ignored.
            random: Random numbers of the episode.

        Raises:
            TaskError: A mover would touch the standing robot within 2 s, or covers the
                goal for ever; or there is no room for a crowd. The message names the
                mover.
        """
        self._check_goal(task)
        movers = Movers.blank(len(self.traits), self.points, task.dt, self.destinations)
        movers.traits[:] = self.traits
        scripted = np.flatnonzero(movers.traits[:, at.KIND] != at.CROWD)
        for m in scripted.tolist():
            _put(movers, m, self.starts[m], random)
        for m in _in_the_way(movers, scripted, task).tolist():
            self._draw_again(movers, m, task, random)
        if self.destinations:
            self._gather(movers, task, random)
        return movers

    def _gather(self, movers: Movers, task: Map2DTask, random: Random) -> None:
        """Draws where the people start: apart from each other and from the robot."""
        traits, now, people = movers.traits, movers.now, movers.people
        crowd = np.flatnonzero(traits[:, at.KIND] == at.CROWD)
        sees = np.zeros(len(traits))
        sees[random.permutation(crowd)[: len(crowd) // 2]] = 1.0
        given = [(m, own) for m, own in enumerate(self.seeing) if own is not None]
        for m, own in given:
            sees[m] = own
        people[:, at.SEES] = sees
        people[:, at.SEED] = random.integers(2**31, size=len(people))
        robot, placed = task.start[: at.Y + 1], np.zeros(len(traits), np.bool_)
        for number, m in enumerate(crowd.tolist()):
            radius, speed = traits[m, at.RADIUS], traits[m, at.SPEED]
            safe = radius + task.robot.radius + SAFE_SECONDS * speed
            for _ in range(MAX_DRAWS):
                _put(movers, m, self.starts[m], random)
                off = now[placed, : at.Y + 1] - now[m, : at.Y + 1]
                apart = np.hypot(*off.T) > radius + traits[placed, at.RADIUS]
                if apart.all() and math.dist(now[m, : at.Y + 1], robot) > safe:
                    break
            else:
                raise TaskError(
                    f"mover {m}: there is room for {number} of the {len(crowd)} people "
                    f"of the crowd, {SAFE_SECONDS:g} s away from the robot"
                )
            placed[m] = True

    def _draw_again(
        self, movers: Movers, m: int, task: Map2DTask, random: Random
    ) -> None:
        if not self.starts[m].is_drawn:
            raise _too_near(movers, m, task)
        for _ in range(MAX_DRAWS):
            _put(movers, m, self.starts[m], random)
            if not _in_the_way(movers, np.array([m]), task).size:
                return
        raise TaskError(
            f"mover {m} reaches the robot within {SAFE_SECONDS:g} s wherever it "
            "starts; move it or the robot, or make it slower"
        )

    def _check_goal(self, task: Map2DTask) -> None:
        for m, own in enumerate(self.starts):
            places = own.stays_within()
            if not places:
                continue
            farthest = max(math.dist(task.goal, place) for place in places)
            if farthest + task.goal_tolerance < _reach(self.traits, m, task):
                x, y = task.goal
                raise TaskError(
                    f"mover {m} covers the goal ({x:.1f}, {y:.1f}) for ever; move one "
                    "of them"
                )


def _size_of(spec: AnySpec, task: Map2DTask) -> tuple[float, float]:
    """Radius (px) and speed (px/s) of a mover."""
    robot = task.robot
    return (
        robot.radius if spec.radius is None else spec.radius,
        0.5 * robot.max_wheel_speed if spec.speed is None else spec.speed,
    )


def _destinations(specs: Sequence[AnySpec], task: Map2DTask) -> Destinations | None:
    """The destinations of the people of all crowds; None without a crowd."""
    sizes = [_size_of(spec, task) for spec in specs if isinstance(spec, CrowdSpec)]
    if not sizes:
        return None
    radius, speed = (max(each) for each in zip(*sizes, strict=True))
    return destinations_of(
        task.terrain.grid, radius, radius + WALL_HORIZON * speed + 1.0
    )


def _put(movers: Movers, m: int, start: Start, random: Random) -> None:
    x, y, remembered = start.place(random)
    movers.now[m] = x, y, 0.0, 0.0, remembered


def _reach(traits: NDArray[np.float64], m: int, task: Map2DTask) -> float:
    """Distance of the centres of robot and mover m when they touch, px."""
    return float(traits[m, at.RADIUS]) + task.robot.radius


def _in_the_way(
    movers: Movers, scripted: NDArray[np.int64], task: Map2DTask
) -> NDArray[np.int64]:
    """Which movers touch the robot at its start within 2 s, or stand on its goal.

    Args:
        movers: All movers; their pieces are overwritten.
        scripted: The movers in question, whose motion does not depend on others.
        task: The task.
    """
    traits, now = movers.traits[scripted], movers.now[scripted]
    off_x, off_y = (now[:, : at.Y + 1] - task.goal).T
    reach, least = traits[:, at.RADIUS] + task.robot.radius, np.empty(len(scripted))
    covers = np.hypot(off_x, off_y) + task.goal_tolerance < reach
    on_goal = covers & (traits[:, at.SPEED] == 0.0)
    nearest_approaches(
        task.terrain.padded_clear,
        traits,
        now,
        movers.points,
        movers.pieces[: len(scripted)],
        float(task.start.x),
        float(task.start.y),
        SAFE_SECONDS,
        least,
    )
    found: NDArray[np.int64] = scripted[(least <= reach) | on_goal]
    return found


def _too_near(movers: Movers, m: int, task: Map2DTask) -> TaskError:
    """Why a given start is refused."""
    x, y = movers.now[m, : at.Y + 1].tolist()
    start, reach = task.start, _reach(movers.traits, m, task)
    gap = math.dist((x, y), start[:2])
    if gap <= reach:
        return TaskError(
            f"mover {m} starts on the robot: their centres are {gap:.1f} px apart and "
            f"need {reach:.1f} px; move one of them"
        )
    return TaskError(
        f"mover {m} starts at ({x:.1f}, {y:.1f}) and reaches the robot, which starts "
        f"at ({start.x:.1f}, {start.y:.1f}), within {SAFE_SECONDS:g} s; move one "
        "of them"
    )
