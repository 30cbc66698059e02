"""What the cameras, lidars and range finders of a robot see in a run."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

import numpy as np

from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.epuck.prisms import Array
from tdac_envs.webots.scenery import Scenery
from tdac_envs.worlds.bodies import floor_under
from tdac_envs.worlds.wbt.colours import Sky
from tdac_envs.worlds.wbt.frames import axis_angle
from tdac_envs.worlds.wbt.robots import ROBOTS
from tdac_envs.worlds.wbt.tree import WbtNode
from tdac_envs.worlds.world import World


class Viewer(Protocol):
    """A device that sees the scenery."""

    @property
    def name(self) -> str:
        """Device name."""

    @property
    def place(self) -> Array:
        """Shape (3,): position relative to the robot (forward, left, up), m."""

    @property
    def axes(self) -> Array:
        """Shape (3, 3): its forward, left and up as columns, in the robot's axes."""

    def view(
        self,
        scenery: Scenery,
        place: Array,
        axes: Array,
        things: Array,
        random: np.random.Generator | None,
    ) -> bytes:
        """What it sees, in Webots' format.

        Args:
            scenery: The scenery.
            place: Shape (3,): its position in the world, m.
            axes: Shape (3, 3): its forward, left and up as columns, in the world.
            things: Shape (k, 3): poses of the objects that can be pushed.
            random: Source of its noise, or None for none.
        """


class Views:
    """Takes views: a sample records the poses, and `image` computes what is seen.

    Args:
        viewers: The devices.
        world: World of the environment.
        sky: Its sky.
        robot: Node of the robot.
        env: The environment.
    """

    def __init__(
        self,
        viewers: Iterable[Viewer],
        world: World,
        sky: Sky,
        robot: WbtNode,
        env: EPuckEnv,
    ) -> None:
        self._viewers = {viewer.name: viewer for viewer in viewers}
        self._world, self._sky, self._env = world, sky, env
        # A Robot node may have its origin above the ground.
        is_proto = robot.kind not in ROBOTS
        self._ground = floor_under(world) if is_proto else world.robot.z
        self._scenery: Scenery | None = None
        self._random = np.random.default_rng(0) if env.sensor_noise > 0.0 else None
        # Poses of the robot and of the movable objects at the last sample.
        self._seen: dict[str, tuple[Array, Array]] = {}
        self._images: dict[str, bytes] = {}
        self._count = 0

    def __contains__(self, name: str) -> bool:
        return name in self._viewers

    def expose(self, name: str) -> int:
        """Takes a sample without computing what is seen; returns its number."""
        self._seen[name] = self._env.pose(), self._env.things()
        self._images.pop(name, None)
        self._count += 1
        return self._count

    def image(self, name: str) -> bytes | None:
        """The last image in Webots' format; None before the first sample."""
        if name not in self._seen:
            return None
        if name not in self._images:
            self._images[name] = self._view(self._viewers[name], *self._seen[name])
        return self._images[name]

    def _view(self, viewer: Viewer, pose: Array, things: Array) -> bytes:
        if self._scenery is None:
            self._scenery = Scenery.of(self._world, self._sky)
        x, y, heading = pose.tolist()
        turn = axis_angle(0.0, 0.0, 1.0, heading)
        place = turn @ viewer.place + (x, y, self._ground)
        axes = turn @ viewer.axes
        return viewer.view(self._scenery, place, axes, things, self._random)
