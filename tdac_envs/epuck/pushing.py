"""What happens when an e-puck pushes things: physics by pymunk, seen from above.

Only steps near a thing that can be pushed, or in which one still moves, come here; all
others are exact and need no physics engine. Each step makes a space of its own from
poses and velocities alone, so that an episode can be copied at any step and goes on
alike.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pymunk
from numpy.typing import NDArray

from tdac_envs.epuck.prisms import FIXED, MID_X, MID_Y, REACH, Array, Prisms
from tdac_envs.worlds.bodies import BODY_RADIUS

ROBOT_MASS = 0.16
"""An e-puck with its two wheels, kg."""
GRIP, SLIDE = 1.0, 0.5
"""Coulomb friction of the robot's tyres and of a thing's foot on the ground; the
first is Webots' default."""
_SKIN = 0.4
_SUBSTEP = 0.002
_GRAVITY = 9.81
_AXLE = 0.052
_STILL = 1e-5
_LEAST = 0.05
# Nothing moves farther than this in a step, m.
_NEAR = 0.05
_ROBOT = 1


class Drive(NamedTuple):
    """What the wheels wish to do in a step.

    Attributes:
        forward: Length of the arc, m.
        turn: rad.
        dt: Duration, s.
    """

    forward: float
    turn: float
    dt: float


class Foot(NamedTuple):
    """A thing that can be pushed, and its friction on the ground.

    Attributes:
        body: Its body.
        slide: Friction against sliding.
        spin: Friction against turning.
        weight: The first's limit while it only slides, N.
        spread: Mean distance of its foot from the centre, m.
    """

    body: Any
    slide: Any
    spin: Any
    weight: float
    spread: float


def is_near(solid: Prisms, state: Array, things: Array, reach: float) -> bool:
    """Whether a thing moves, or is within `reach` (m) of the robot's hull.

    Args:
        solid: What is solid, where it is now.
        state: Begins with the robot's x and y.
        things: Shape (k, 6): x, y, angle and their velocities, of what can be pushed.
        reach: m.
    """
    if np.abs(things[:, 3:]).max(initial=0.0) > 0.0:
        return True
    mine = solid.extent[solid.owner != FIXED]
    off = np.hypot(mine[:, MID_X] - state[0], mine[:, MID_Y] - state[1])
    return bool((off - mine[:, REACH] - BODY_RADIUS < reach).any())


def push(
    solid: Prisms,
    origin: Prisms,
    centres: Array,
    masses: Array,
    state: Array,
    speed: Array,
    things: Array,
    drive: Drive,
) -> bool:
    """One step with physics.

    Args:
        solid: What is solid, where it is now.
        origin: The same where it was at first.
        centres: Shape (k, 2): where the things were at first.
        masses: Shape (k,), kg.
        state: Begins with the robot's x, y and heading; overwritten.
        speed: Shape (3,): the robot's velocity (m/s) and rate of turn (rad/s);
            overwritten.
        things: Shape (k, 6), as for `is_near`; overwritten.
        drive: What the wheels wish.

    Returns:
        Whether the robot's body touched anything.
    """
    space = pymunk.Space()
    space.iterations = 30
    # The defaults are made for pixels: these are metres.
    space.collision_slop, space.collision_bias = 1e-6, 0.0
    feet = [
        _thing(space, origin, k, centres[k], float(masses[k]), things[k])
        for k in range(len(things))
    ]
    _add_fixed(space, solid, state)
    robot, wheels = _robot(space, state, speed)
    touched: list[bool] = []
    space.on_collision(_ROBOT, None, post_solve=lambda *_: touched.append(True))
    count = max(math.ceil(drive.dt / _SUBSTEP), 1)
    for _ in range(count):
        _wish(wheels, robot, drive, count)
        for foot in feet:
            _share_friction(foot)
        space.step(drive.dt / count)
    state[:3] = *robot.position, math.remainder(robot.angle, 2.0 * math.pi)
    speed[:] = *robot.velocity, robot.angular_velocity
    for (body, *_), row in zip(feet, things, strict=True):
        row[:] = *body.position, body.angle, *body.velocity, body.angular_velocity
        if np.abs(row[3:]).max() < _STILL:
            row[3:] = 0.0
    return bool(touched)


def _wish(wheels: Any, robot: Any, drive: Drive, count: int) -> None:
    """Sets the speed that the tyres pull the robot to: the chord of the next arc."""
    dt, turn = drive.dt / count, drive.turn / count
    half = 0.5 * turn
    chord = drive.forward / count * (math.sin(half) / half if half else 1.0)
    middle = robot.angle + half
    wheels.position, wheels.angle = robot.position, robot.angle
    wheels.velocity = (
        chord / dt * math.cos(middle),
        chord / dt * math.sin(middle),
    )
    wheels.angular_velocity = turn / dt


def _robot(space: Any, state: Array, speed: Array) -> tuple[Any, Any]:
    """The robot, and the body that stands for its wheels and pulls it by friction."""
    moment = pymunk.moment_for_circle(ROBOT_MASS, 0.0, BODY_RADIUS)
    robot = pymunk.Body(ROBOT_MASS, moment)
    robot.position, robot.angle = (float(state[0]), float(state[1])), float(state[2])
    robot.velocity, robot.angular_velocity = (
        (float(speed[0]), float(speed[1])),
        float(speed[2]),
    )
    hull = pymunk.Circle(robot, BODY_RADIUS)
    hull.friction, hull.collision_type = _SKIN, _ROBOT
    wheels = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
    wheels.position, wheels.angle = robot.position, robot.angle
    pull = GRIP * ROBOT_MASS * _GRAVITY
    space.add(robot, hull, wheels, *_held(wheels, robot, pull, pull * _AXLE / 2))
    return robot, wheels


def _thing(
    space: Any, origin: Prisms, number: int, centre: Array, mass: float, row: Array
) -> Foot:
    """A thing that can be pushed, with friction on the ground."""
    outlines: list[tuple[Array, float]] = []
    for part in np.flatnonzero(origin.owner == number).tolist():
        radius = float(origin.extent[part, 3])
        outlines.append((origin.outline(part) - centre, radius))
    far = max(
        (float(np.hypot(*at.T).max()) + radius for at, radius in outlines),
        default=0.01,
    )
    spread = far / math.sqrt(3.0)
    body = pymunk.Body(mass, mass * spread**2)
    body.position, body.angle = (float(row[0]), float(row[1])), float(row[2])
    body.velocity = float(row[3]), float(row[4])
    body.angular_velocity = float(row[5])
    space.add(body)
    for at, radius in outlines:
        _add_shape(space, body, at, radius)
    weight = SLIDE * mass * _GRAVITY
    slide, spin = _held(space.static_body, body, weight, weight * spread)
    space.add(slide, spin)
    return Foot(body, slide, spin, weight, spread)


def _share_friction(foot: Foot) -> None:
    """What slides turns easily, and the other way round: an elliptic limit surface."""
    slid = foot.body.velocity.length
    spun = abs(foot.body.angular_velocity) * foot.spread
    speed = math.hypot(slid, spun)
    shares = (slid / speed, spun / speed) if speed > _STILL else (1.0, 1.0)
    foot.slide.max_force = foot.weight * max(shares[0], _LEAST)
    foot.spin.max_force = foot.weight * foot.spread * max(shares[1], _LEAST)


def _held(one: Any, other: Any, force: float, torque: float) -> list[Any]:
    """Friction between two bodies: it ends their relative motion, within limits."""
    at = other.position
    slide = pymunk.PivotJoint(one, other, one.world_to_local(at), (0.0, 0.0))
    spin = pymunk.GearJoint(one, other, 0.0, 1.0)
    for joint, limit in ((slide, force), (spin, torque)):
        joint.max_bias, joint.max_force = 0.0, limit
    return [slide, spin]


def _add_fixed(space: Any, solid: Prisms, state: Array) -> None:
    """The fixed parts that the robot, or a thing, might touch in a step."""
    movers = np.vstack(
        [[(state[0], state[1], BODY_RADIUS)], solid.extent[solid.owner != FIXED, :3]]
    )
    for part in np.flatnonzero(solid.owner == FIXED).tolist():
        x, y, reach = solid.extent[part, :3].tolist()
        off = np.hypot(movers[:, 0] - x, movers[:, 1] - y)
        if (off - movers[:, 2] - reach < _NEAR).any():
            radius = float(solid.extent[part, 3])
            _add_shape(space, space.static_body, solid.outline(part), radius)


def _add_shape(space: Any, body: Any, at: NDArray[np.float64], radius: float) -> None:
    if len(at) == 1:
        x, y = at[0].tolist()
        shape: Any = pymunk.Circle(body, radius, (x, y))
    else:
        shape = pymunk.Poly(body, [(x, y) for x, y in at.tolist()])
    shape.friction = _SKIN
    space.add(shape)
