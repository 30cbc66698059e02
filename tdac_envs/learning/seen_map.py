"""A map that a robot makes of what its rays showed, as an observation.

It uses nothing but what the robot observes: ranges, and its pose or what its odometry
adds up to, with all errors. Where a task set gives the map of the world, that is where
it begins. `SeenMap` shows what the map holds around the robot, `Waypoints` the next
points on the cheapest way to the goal on this map.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any, Literal, Self

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from tdac_envs.core.errors import TaskError
from tdac_envs.core.slices import Slices
from tdac_envs.drive.env import Observation
from tdac_envs.drive.stepping import STEPS
from tdac_envs.learning.body_frame import seen_from
from tdac_envs.learning.dead_reckoning import DeadReckoning, reckoning, source_of
from tdac_envs.learning.seen_kernels import (
    MARGIN,
    PER_RADIUS,
    UNKNOWN,
    add_scans,
    add_walls,
    look_around,
)
from tdac_envs.learning.seen_ways import MOST_AHEAD, MOST_SIDE, look_along
from tdac_envs.map2d.setup import Map2DSetup

Array = NDArray[np.float64]

CELL = 1.0 / PER_RADIUS
"""Side of a cell, body radii."""
SECTORS = 24
RINGS = (1.0, 2.5, 5.0, 10.0, 20.0)
"""Bounds of the rings around the robot, body radii."""
_IN_BIN = (3, 2)
"""Points of a bin: outwards, and across."""
BINS = SECTORS * (len(RINGS) - 1)
AHEAD = (1.0, 2.0, 4.0, 8.0)
"""Distances of the waypoints along the way, body radii."""
_MOST_RAYS = 90
"""Of more rays, every second one, or every third one, … is used."""

View = Literal["seen", "waypoints"]
"""Key of what is observed."""
SHAPES: dict[View, tuple[int, ...]] = {
    "seen": (2, BINS),
    "waypoints": (len(AHEAD), 2),
}


@dataclass(frozen=True, slots=True, eq=False)
class Seeing:
    """How a robot sees, in the frame of what it observes.

    Attributes:
        radius: Body radius, px or m.
        up: Whether y points up, and angles are counter-clockwise.
        largest: Largest range, px or m.
        rays: The rays that are used.
        directions: Shape (rays, 2): their directions, ahead and along the y axis.
        offset: Shape (2,): where they start, ahead and along the robot's y axis.
        side: Width and height of the map that is made, cells.
        shift: Where the origin of the frame is on it, cells, in x and in y.
        per_px: Length of a pixel of a given map: 1, or m.
        source: Key of the odometry, if there is no pose.
        axle: Length of the axle, for encoders.
        given: Whether the map is given.
    """

    radius: float
    up: bool
    largest: float
    rays: slice
    directions: Array
    offset: Array
    side: int
    shift: float
    per_px: float
    source: str | None
    axle: float
    given: bool

    @classmethod
    def of(cls, setup: Any, own: spaces.Space[Any]) -> Self:
        """How the robot of a setup sees.

        Args:
            setup: Setup of an environment on maps.
            own: Its original observation space.

        Raises:
            TaskError: It has no ranges, or neither a pose nor odometry; or its map
                would be too large.
        """
        keys = own.spaces if isinstance(own, spaces.Dict) else {}
        source = None if "pose" in keys else source_of(own)
        is_map = isinstance(setup, Map2DSetup)
        if not is_map or "ranges" not in keys or not ("pose" in keys or source):
            raise TaskError(
                "expected original observations with ranges, and a pose or odometry, "
                f"got {own}"
            )
        task, metric = setup.nominal, getattr(setup, "metric", None)
        scale = setup.resolution or (metric and metric.resolution)
        turn = 1.0 if scale is None else -1.0
        per_px = 1.0 if scale is None else float(scale)
        robot = task.robot
        ahead, aside = robot.scanner_offset or (0.0, 0.0)
        angles = turn * robot.angles()
        rays = slice(None, None, -(-robot.n_rays // _MOST_RAYS))
        goal: Any = keys["goal"]
        low, high = float(np.min(goal.low)), float(np.max(goal.high))
        cell = CELL * task.body_radius * per_px
        side = int(np.ceil((high - low) / cell)) + 2 * MARGIN + 1
        if side > MOST_SIDE:
            raise TaskError(
                f"the robot's own map would have {side:,} x {side:,} cells of {CELL} "
                f"body radii (limit {MOST_SIDE:,} x {MOST_SIDE:,}): leave out the "
                "wrappers seen-map and waypoints"
            )
        return cls(
            radius=task.body_radius * per_px,
            up=scale is not None,
            largest=float(robot.range_max) * per_px,
            rays=rays,
            directions=np.stack([np.cos(angles), np.sin(angles)], axis=-1)[rays],
            offset=np.array([ahead, turn * aside]) * per_px / cell,
            side=side,
            shift=MARGIN - low / cell,
            per_px=per_px,
            source=source,
            axle=task.axle_length,
            given=bool(getattr(setup.source, "gives_map", False)),
        )

    def is_like(self, other: Seeing) -> bool:
        """Whether another robot sees in the same way, in a frame of the same size."""
        names = [field.name for field in fields(self)]
        return all(
            np.array_equal(np.asarray(mine), np.asarray(theirs))
            for mine, theirs in (
                (getattr(self, name), getattr(other, name))
                for name in names
                if name != "rays"
            )
        )

    @property
    def cell(self) -> float:
        """Side of a cell, px or m."""
        return CELL * self.radius


class SeenMaps:
    """The maps that some robots make.

    Args:
        seeing: How each of them sees.
        count: Number of robots.
        threads: Number of threads; by default the number of cores.
    """

    def __init__(self, seeing: Seeing, count: int, threads: int | None = None) -> None:
        self.seeing = seeing
        side = seeing.side
        self.walls = np.full((count, side, side), UNKNOWN, np.int8)
        self.visits = np.zeros((count, side, side), np.uint8)
        self.costs = np.ones((count, side, side), np.int16)
        self._routes = np.zeros((count, MOST_AHEAD, 2), np.int32)
        self._routed = np.zeros((count, 3), np.int32)
        self._poses, self._goals = np.zeros((count, 3)), np.zeros((count, 2))
        self._largest = np.full(count, seeing.largest / seeing.cell)
        self._samples = _samples(seeing.up)
        self._reaches = np.array(AHEAD) / CELL
        self._reckoned: DeadReckoning | None = None
        if seeing.source is not None:
            self._reckoned = reckoning(seeing.source, [seeing.axle] * count, count)
        self._steps = np.full(count, -1.0)
        self._views: dict[View, NDArray[np.float32]] = {}
        self._stale: dict[View, NDArray[np.bool_]] = {}
        self._threads, self._slices = threads, Slices(threads)

    def follow(self, seen: Any, steps: ArrayLike, maps: Sequence[Any]) -> None:
        """Adds the observations of all robots.

        Args:
            seen: Original observations, with a first axis for the robots.
            steps: Steps of each episode so far. A robot at 0 is at its start; one whose
                number has not changed has not moved.
            maps: The given map of each robot, bool, `[y, x]`, True = occupied; None
                where no map is given. Read at the start of an episode.
        """
        now = np.asarray(steps, np.float64)
        begun = np.flatnonzero(now == 0.0)
        rows = np.flatnonzero((now != self._steps) | (now == 0.0))
        for i in begun.tolist():
            self._begin(i, maps[i])
        if self._reckoned is None:
            poses = np.asarray(seen["pose"], np.float64)
        else:
            poses = self._reckoned.follow(seen[self.seeing.source], steps)
        self._place(poses, seen["goal"])
        self._add(rows, seen["ranges"])
        self._steps = now.copy()

    def end(self, rows: NDArray[np.int64], seen: Any) -> None:
        """Adds the last observations of episodes, which others follow."""
        if self._reckoned is None:
            poses = np.asarray(seen["pose"], np.float64)
        else:
            poses = self._reckoned.ahead(seen[self.seeing.source])
        self._place(poses[rows], seen["goal"][rows], rows)
        self._steps[rows] += 1.0
        self._add(rows, seen["ranges"])

    def view(self, key: View) -> NDArray[np.float32]:
        """What the robots' maps show them, shape (n, *`SHAPES[key]`); read only.

        Args:
            key: `seen` for what is around them, or `waypoints` for points on their way.
        """
        if key not in self._views:
            count = len(self._poses)
            self._views[key] = np.zeros((count, *SHAPES[key]), np.float32)
            self._stale[key] = np.ones(count, np.bool_)
        found = self._views[key]
        rows = np.flatnonzero(self._stale[key])
        self._stale[key][:] = False
        if key == "seen":
            own = self._poses, self._samples, self.walls, self.visits, found
            self._slices.run(lambda part: look_around(part, *own), rows)
        else:
            found[rows] = self._waypoints(rows)
        return found.copy()

    def _waypoints(self, rows: NDArray[np.int64]) -> NDArray[np.float32]:
        """The next points on the ways of some robots, as `Waypoints` says."""
        points = np.empty((len(self._poses), *SHAPES["waypoints"]))
        own = (
            *(self._poses, self._goals, self._reaches, self._steps),
            *(self.costs, self._routes, self._routed, points),
        )
        self._slices.run(lambda part: look_along(part, *own), rows)
        seen = seen_from(self._poses[rows, None], points[rows], self.seeing.up)
        shares = seen / self._reaches[:, None]
        return np.clip(shares, -1.0, 1.0).astype(np.float32)

    def close(self) -> None:
        """Stops the threads."""
        self._slices.close()

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_slices": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._slices = Slices(self._threads)

    def _begin(self, i: int, given: Any) -> None:
        self.walls[i], self.costs[i], self.visits[i] = UNKNOWN, 1, 0
        self._routed[i] = 0
        if given is not None:
            seeing = self.seeing
            scale, shift = seeing.per_px / seeing.cell, seeing.shift
            cells = np.array(given, np.bool_)
            if seeing.up:  # metres, from the lower left corner
                cells, shift = np.ascontiguousarray(cells[::-1]), shift + 0.5 * scale
            add_walls(cells, scale, shift, self.walls[i], self.costs[i])

    def _place(self, poses: Array, goals: Any, rows: Any = ...) -> None:
        cell, shift = self.seeing.cell, self.seeing.shift
        places = poses[:, :2] / cell + shift
        self._poses[rows] = np.concatenate([places, poses[:, 2:]], axis=-1)
        self._goals[rows] = np.asarray(goals, np.float64) / cell + shift

    def _add(self, rows: NDArray[np.int64], ranges: NDArray[np.float32]) -> None:
        for stale in self._stale.values():
            stale[rows] = True
        seeing = self.seeing
        shares = ranges[:, seeing.rays] / np.float32(seeing.largest)
        own = (
            *(self._poses, np.ascontiguousarray(shares), self._largest),
            *(seeing.directions, seeing.offset, self.walls, self.costs, self.visits),
        )
        self._slices.run(lambda part: add_scans(part, *own), rows)


def _samples(up: bool) -> Array:
    """The places of each bin, cells, shape (`BINS`, points, 2).

    Bins go outwards; in a ring, from ahead to the left and all around.
    """
    outwards, across = _IN_BIN
    places = []
    for near, far in pairwise(RINGS):
        for sector in range(SECTORS):
            points = []
            for k in range(outwards):
                for j in range(across):
                    share = (j + 0.5) / across - 0.5
                    bearing = 2.0 * np.pi * (sector + share) / SECTORS
                    length = (near + (far - near) * (k + 0.5) / outwards) / CELL
                    turn = bearing if up else -bearing
                    points.append((length * np.cos(turn), length * np.sin(turn)))
            places.append(points)
    return np.array(places)


VIEWS: dict[str, View] = {"seen-map": "seen", "waypoints": "waypoints"}
"""Keys by the names of their wrappers."""


def with_view(own: spaces.Space[Any], key: View) -> spaces.Dict:
    """An observation space with one of the observations added."""
    assert isinstance(own, spaces.Dict)
    box = spaces.Box(-1.0, 1.0, SHAPES[key], np.float32)
    return spaces.Dict({**own.spaces, key: box})


class _OwnMap(
    gym.ObservationWrapper[Observation, NDArray[np.float32], Observation],
    gym.utils.RecordConstructorArgs,
):
    """Adds what a robot's own map says."""

    key: View

    def __init__(self, env: gym.Env[Any, NDArray[np.float32]]) -> None:
        gym.utils.RecordConstructorArgs.__init__(self)
        gym.ObservationWrapper.__init__(self, env)
        plain: Any = env.unwrapped
        seeing = Seeing.of(plain.setup, env.observation_space)
        space = with_view(env.observation_space, self.key)
        self.observation_space = space  # type: ignore[assignment]
        self.maps = SeenMaps(seeing, 1, threads=1)

    def observation(self, observation: Observation) -> Observation:
        """See the class."""
        plain: Any = self.unwrapped
        steps = plain.robot.state[STEPS]
        one = {key: value[None] for key, value in observation.items()}
        given = plain.given_map() if self.maps.seeing.given else None
        self.maps.follow(one, [steps], [given])
        return {**observation, self.key: self.maps.view(self.key)[0]}


class SeenMap(_OwnMap):
    """Adds what the rays have shown around the robot since the start, and where it was.

    | key | shape | range | content |
    |---|---|---|---|
    | `seen` | (2, 96) | [-1, 1] | 24 sectors of 4 rings, up to 20 body radii: 1 if a |
    | | | | wall is known there, else minus the share that is known; and how long the |
    | | | | robot was there, 0 for never |

    Bins go from the inner ring outwards, and in a ring from ahead to the left and all
    around. Where the map is given, it is known from the beginning.

    Args:
        env: An environment on maps with its original observations, among them ranges,
            and a pose or odometry.
    """

    key = "seen"


class Waypoints(_OwnMap):
    """Adds points on the cheapest way to the goal on the robot's own map.

    | key | shape | range | content |
    |---|---|---|---|
    | `waypoints` | (4, 2) | [-1, 1] | points 1, 2, 4, 8 body radii along the way: |
    | | | | distances ahead and to the robot's left, as shares of these lengths |

    The way leads through what no ray has shown, too, and keeps away from walls. It is
    found anew every 12 steps, and when a wall is seen on it.

    Args:
        env: As for `SeenMap`.
    """

    key = "waypoints"
