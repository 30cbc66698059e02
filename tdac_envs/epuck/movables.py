"""The objects that an e-puck may push: where they are, and steps in which they move."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.addresses import Words
from tdac_envs.drive.stepping import FORWARD, TOUCHED, TURN
from tdac_envs.epuck import kernels
from tdac_envs.epuck.robot import EPuckArrays
from tdac_envs.epuck.setup import EPuckSetup
from tdac_envs.epuck.task import EPuckTask
from tdac_envs.physics.moved import Pose


class Movables:
    """The objects that have a mass, at their current positions.

    Args:
        setup: Configuration of the environment.
        task: A task in the world of the objects.

    Attributes:
        solid: Solid parts at their current positions.
        seen: Visible parts at their current positions.
        things: Shape (k, 6): x, y (m), angle (rad) of each object, and their
            velocities.
        moves: Whether steps are run by `step`.
    """

    def __init__(self, setup: EPuckSetup, task: EPuckTask) -> None:
        self._task, self._visible = task, setup.around(task).visible
        ground = task.ground
        # `ground.solid` and `visible` keep the initial positions.
        self.solid, self.seen = ground.solid, self._visible
        self.moves = setup.pushes
        if setup.pushes:
            self.solid, self.seen = self.solid.copy(), self.seen.copy()
        self.things: NDArray[np.float64] = np.zeros((len(ground.masses), 6))
        self._speed = np.zeros(3)
        self.things[:, :2] = ground.centres

    def reset(self, start: Pose) -> None:  # noqa: ARG002 - of the robot
        """Puts all objects where they are in the world file, at rest."""
        if not self.moves:
            return
        self._speed[:] = 0.0
        self.things[:] = 0.0
        self.things[:, :2] = self._task.ground.centres
        self._carry()

    def step(self, words: Words, robot: EPuckArrays, drive: Callable[[], None]) -> None:
        """Runs one step, with the physics engine if an object is near or moves.

        Args:
            words: Addresses of the arrays; see `kernels.begin`.
            robot: Arrays of the robot.
            drive: Runs the step without the physics engine.
        """
        from tdac_envs.epuck.pushing import CommandedArc, is_near, push

        task, state, outcome = self._task, robot.state, robot.outcome
        if not is_near(self.solid, state, self.things, 1.5 * task.full_step):
            self._speed[:] = 0.0
            drive()
            return
        kernels.turn_wheels(words)
        forward, turn = state[FORWARD : TURN + 1].tolist()
        drive_arc = CommandedArc(forward, turn, task.dt)
        outcome[TOUCHED] = push(
            self.solid, task.ground, state, self._speed, self.things, drive_arc
        )
        self._carry()
        kernels.finish(words)

    def _carry(self) -> None:
        """Moves the solid and visible parts to the current poses of their objects."""
        ground = self._task.ground
        self.solid.carry(ground.solid, ground.centres, self.things)
        self.seen.carry(self._visible, ground.centres, self.things)
