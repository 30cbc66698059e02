"""Configuration of a TDAC-EPuck-v0 environment, and the tasks of its episodes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.arguments import non_negative, one_of
from tdac_envs.drive.setup import DriveSetup
from tdac_envs.drive.smallest_gap import required_gap
from tdac_envs.drive.stepping import AXLE, FRICTION
from tdac_envs.epuck.infrared import RANGE
from tdac_envs.epuck.kernels import FLOOR, N_CONSTANTS
from tdac_envs.epuck.nearby import NearbyParts, surroundings
from tdac_envs.epuck.paths import widest_body
from tdac_envs.epuck.prisms import Prisms
from tdac_envs.epuck.task import EPuckTask
from tdac_envs.physics.engine_choice import EXACT_STEP, Engine
from tdac_envs.worlds.bodies import BODY_RADIUS


@dataclass(frozen=True, slots=True, eq=False)
class EPuckSetup(DriveSetup):
    """The part of an environment that does not change between episodes.

    Attributes:
        webots: Whether the sensors see Webots' reflectances; see `Ground.visible`.
        goal_visible: Whether the sensors see the file's goal marker.
        stopping_distance: Of the robot, from full speed, m.
        physics: What moves the robot.
        view: `"2d"` or `"3d"`, of frames.
    """

    nominal: EPuckTask
    webots: bool
    goal_visible: bool
    stopping_distance: float = 0.0
    physics: Engine = EXACT_STEP
    view: str = "2d"

    def __post_init__(self) -> None:
        DriveSetup.__post_init__(self)
        least = non_negative("stopping_distance", self.stopping_distance)
        object.__setattr__(self, "stopping_distance", least)
        one_of("view", self.view, ("2d", "3d"))

    def required_gap(self, task: EPuckTask) -> float:
        """See `DriveSetup.required_gap`."""
        widest = partial(widest_body, task.ground, task.start[:2], task.goal)
        return required_gap(BODY_RADIUS, self.stopping_distance, widest)

    @property
    def pushes(self) -> bool:
        """Whether the robot can push objects without another physics."""
        if not self.physics.is_exact:
            return False
        return self.on_collision == "block" and len(self.nominal.ground.masses) > 0

    def around(self, task: EPuckTask) -> NearbyParts:
        """The parts that the robot may touch and see, depending on its position."""
        reach = BODY_RADIUS + task.full_step
        return surroundings(task.ground, self.webots, self.goal_visible, reach)

    def constants(self) -> NDArray[np.float64]:
        """`EPuckArrays.constants` of the nominal task."""
        task = self.nominal
        friction = task.ground.world.friction
        shared = self.shared_constants(task.max_wheel_speed, RANGE, friction)
        constants = np.array([*shared, *np.zeros(N_CONSTANTS - FLOOR)], np.float64)
        self.enter(constants, task)
        return constants

    def enter(self, constants: NDArray[np.float64], task: EPuckTask) -> None:
        """Sets what `EPuckArrays.constants` tells of the world of a task."""
        ground = task.ground
        constants[AXLE] = task.axle_length
        constants[FRICTION] = ground.world.friction
        constants[FLOOR:] = (
            ground.floor,
            *ground.bounds[:2],
            ground.spacing,
            self.around(task).width,
        )

    def world(
        self,
        task: EPuckTask,
        solid: Prisms | None = None,
        seen: Prisms | None = None,
    ) -> tuple[NDArray[Any], ...]:
        """The arrays that the kernels take in addition to the robot's.

        Args:
            task: Task of the episode.
            solid: Solid parts, if objects can be pushed; by default the ground's own.
            seen: Visible parts, if objects can be pushed; by default those of
                `around`.
        """
        around = self.around(task)
        solid = task.ground.solid if solid is None else solid
        seen = around.visible if seen is None else seen
        near, sighted = around.solid, around.seen
        return (
            solid.points, solid.first, solid.extent, near.cells, near.listed,
            seen.points, seen.first, seen.extent, sighted.cells, sighted.listed,
            task.field,
        )  # fmt: skip
