"""An e-puck, and the objects that it can push, moved by another physics."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.addresses import Words
from tdac_envs.core.errors import TaskError
from tdac_envs.drive.stepping import FORWARD, HEADING, TOUCHED, TURN
from tdac_envs.epuck import infrared, kernels
from tdac_envs.epuck.ground import Ground, fence
from tdac_envs.epuck.kernels import LEFT_TURNED, RIGHT_TURNED, WHEEL_RADIUS
from tdac_envs.epuck.movables import Movables
from tdac_envs.epuck.robot import EPuckArrays
from tdac_envs.epuck.setup import EPuckSetup
from tdac_envs.epuck.task import EPuckTask
from tdac_envs.physics.body import BodySpec, e_puck_body
from tdac_envs.physics.moved import Pose, arc_between, rim_speeds
from tdac_envs.physics.scene import Scene, grip_in, scene_of


class Carried(Movables):
    """The robot and the objects that have a mass, moved by MuJoCo.

    The angles of the wheels are the commanded ones and what the motors missed. The arc
    of a step is the one nearest to the motion.

    Args:
        setup: Configuration of the environment.
        task: A task in the world of the objects.

    Raises:
        TaskError: MuJoCo is not installed, or would measure rays to a goal's marker.
    """

    def __init__(self, setup: EPuckSetup, task: EPuckTask) -> None:
        from tdac_envs.physics.engine import MujocoBody

        super().__init__(setup, task)
        ground = task.ground
        if setup.physics.measures and setup.goal_visible:
            raise TaskError("goal_visible: MuJoCo's rays do not see the goal's marker")
        self._has_reflectances = setup.webots
        self.moves = True
        self.solid, self.seen = ground.solid.copy(), self._visible.copy()
        body = setup.physics.body_like(body_of(ground))
        self.body = MujocoBody(scene_at(ground), body)

    def reset(self, start: Pose) -> None:
        """Begins an episode at a pose, with all objects at rest."""
        self.body.reset(start)
        self._follow()

    def step(self, words: Words, robot: EPuckArrays, drive: Callable[[], None]) -> None:  # noqa: ARG002
        """Runs one step with MuJoCo; see `Movables.step`."""
        state, task = robot.state, self._task
        kernels.turn_wheels(words)
        forward, turn = state[FORWARD : TURN + 1].tolist()
        speeds = rim_speeds(forward, turn, task.axle_length, task.dt)
        x, y, heading = state[: HEADING + 1].tolist()
        moved = self.body.step(*speeds, task.dt)
        for entry, speed, turned in zip(
            (LEFT_TURNED, RIGHT_TURNED), speeds, moved.turned, strict=True
        ):
            state[entry] += turned - speed * task.dt / WHEEL_RADIUS
        state[: HEADING + 1] = moved.pose
        state[FORWARD], state[TURN] = arc_between((x, y, heading), moved.pose)
        robot.outcome[TOUCHED] = moved.touched
        self._follow()
        kernels.finish(words)

    def measure(self, robot: EPuckArrays) -> None:
        """Replaces the readings of ps0 to ps7 by those along MuJoCo's rays."""
        x, y, heading = robot.state[: HEADING + 1].tolist()
        rays = infrared.rays_at(x, y, heading, self._task.ground.floor)
        hits = self.body.hits(*rays, infrared.RANGE)
        if not self._has_reflectances:
            hits[:, 1] = 1.0
        at, table = hits[:, 0] / hits[:, 1], infrared.TABLE
        robot.hits[:, :2] = hits
        robot.readings[:] = np.interp(at, table[:, 0], table[:, 1])
        robot.hits[:, 2] = np.interp(at, table[:, 0], table[:, 2])

    def _follow(self) -> None:
        """Takes the poses of the objects from the physics."""
        self.things[:, :3] = self.body.things()
        self._carry()


def movables_of(setup: EPuckSetup, task: EPuckTask) -> Movables:
    """The objects of a task's world, with the physics that moves them."""
    kind = Movables if setup.physics.is_exact else Carried
    return kind(setup, task)


def scene_at(ground: Ground) -> Scene:
    """The scene of a ground, with its fence."""
    centres: NDArray[np.float64] = ground.centres
    return scene_of(
        ground.world, fence(ground.bounds), [(x, y) for x, y in centres.tolist()]
    )


def body_of(ground: Ground) -> BodySpec:
    """The body of the robot of a world."""
    robot = ground.world.robot
    return e_puck_body(robot.mass, robot.axle_length, grip_in(ground.world))
