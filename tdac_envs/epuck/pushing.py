"""2D physics (pymunk) of an e-puck that pushes objects.

It is used only for steps in which an object that can be pushed is near or moves; all
other steps are exact and need no physics engine. Each step creates a new pymunk space
from poses and velocities alone, so a copy of an episode continues identically.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pymunk

from tdac_envs.epuck.ground import Ground
from tdac_envs.epuck.prisms import FIXED, MID_X, MID_Y, REACH, Array, Prisms
from tdac_envs.worlds.bodies import BODY_RADIUS

_SUBSTEP = 0.002
_GRAVITY = 9.81
_STILL = 1e-5
_LEAST = 0.05
# Bound on how far anything moves in a step, m.
_NEAR = 0.05
# Collision types: everything fixed, the robot's hull, the first object.
_FIXED, _ROBOT, _FIRST = range(3)


class CommandedArc(NamedTuple):
    """The motion commanded for a step.

    Attributes:
        forward: Length of the arc, m.
        turn: Change of heading, rad.
        dt: Duration, s.
    """

    forward: float
    turn: float
    dt: float


class PushedObject(NamedTuple):
    """An object that can be pushed, with its friction on the ground.

    Attributes:
        body: pymunk body.
        slide: Friction joint against sliding.
        spin: Friction joint against turning.
        max_force: Friction force while the object slides without turning, N.
        spread: Mean distance of its contact area from the centre, m.
    """

    body: Any
    slide: Any
    spin: Any
    max_force: float
    spread: float


def is_near(solid: Prisms, state: Array, things: Array, reach: float) -> bool:
    """Whether an object moves, or is within `reach` of the robot's hull.

    Args:
        solid: Solid parts at their current positions.
        state: Begins with the robot's x and y.
        things: Shape (k, 6): x, y, angle and their velocities, for each object that can
            be pushed.
        reach: Distance, m.
    """
    if np.abs(things[:, 3:]).max(initial=0.0) > 0.0:
        return True
    mine = solid.extent[solid.owner != FIXED]
    off = np.hypot(mine[:, MID_X] - state[0], mine[:, MID_Y] - state[1])
    return bool((off - mine[:, REACH] - BODY_RADIUS < reach).any())


def push(
    solid: Prisms,
    ground: Ground,
    state: Array,
    speed: Array,
    things: Array,
    drive: CommandedArc,
) -> bool:
    """Simulates one step with physics.

    Args:
        solid: Solid parts at their current positions.
        ground: The world, with the objects at their initial positions.
        state: Begins with the robot's x, y and heading; overwritten.
        speed: Shape (3,): the robot's velocity (m/s) and turn rate (rad/s);
            overwritten.
        things: Shape (k, 6), as for `is_near`; overwritten.
        drive: Commanded motion of the robot.

    Returns:
        Whether the robot's body touched anything.
    """
    space = pymunk.Space()
    space.iterations = 30
    # pymunk's defaults assume pixels, not metres.
    space.collision_slop, space.collision_bias = 1e-6, 0.0
    movables = [_add_movable(space, ground, k, row) for k, row in enumerate(things)]
    _add_fixed(space, solid, state)
    robot, wheels = _add_robot(space, ground, state, speed)
    touched: list[bool] = []
    _set_frictions(space, ground.frictions.touching)
    space.on_collision(_ROBOT, None, post_solve=lambda *_: touched.append(True))
    count = max(math.ceil(drive.dt / _SUBSTEP), 1)
    for _ in range(count):
        _set_wheel_velocity(wheels, robot, drive, count)
        for movable in movables:
            _limit_friction(movable)
        space.step(drive.dt / count)
    state[:3] = *robot.position, math.remainder(robot.angle, 2.0 * math.pi)
    speed[:] = *robot.velocity, robot.angular_velocity
    for (body, *_), row in zip(movables, things, strict=True):
        row[:] = *body.position, body.angle, *body.velocity, body.angular_velocity
        if np.abs(row[3:]).max() < _STILL:
            row[3:] = 0.0
    return bool(touched)


def _set_wheel_velocity(
    wheels: Any, robot: Any, drive: CommandedArc, count: int
) -> None:
    """Sets the velocity towards which the tyres pull the robot, for one substep."""
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


def _set_frictions(space: Any, touching: Array) -> None:
    """Sets the friction of each pair of bodies; see `Frictions.touching`."""
    first = float(touching[0, 0])
    if (touching == first).all():  # faster than a call for each contact
        for shape in space.shapes:  # the engine multiplies those of two shapes
            shape.friction = math.sqrt(first)
        return

    def rub(arbiter: Any, *_: Any) -> None:
        # Everything fixed and the robot are the last entry.
        one, other = (max(s.collision_type - _FIRST, -1) for s in arbiter.shapes)
        arbiter.friction = touching[one, other]

    space.on_collision(None, None, pre_solve=rub)


def _add_robot(
    space: Any, ground: Ground, state: Array, speed: Array
) -> tuple[Any, Any]:
    """Adds the robot, and a kinematic body that models its wheels by friction."""
    mass, axle = ground.world.robot.mass, ground.world.robot.axle_length
    robot = pymunk.Body(mass, pymunk.moment_for_circle(mass, 0.0, BODY_RADIUS))
    robot.position, robot.angle = (float(state[0]), float(state[1])), float(state[2])
    robot.velocity, robot.angular_velocity = (
        (float(speed[0]), float(speed[1])),
        float(speed[2]),
    )
    hull = pymunk.Circle(robot, BODY_RADIUS)
    hull.collision_type = _ROBOT
    wheels = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
    wheels.position, wheels.angle = robot.position, robot.angle
    pull = ground.frictions.tyres * mass * _GRAVITY
    space.add(robot, hull, wheels, *_friction(wheels, robot, pull, pull * axle / 2))
    return robot, wheels


def _add_movable(space: Any, ground: Ground, number: int, row: Array) -> PushedObject:
    """Adds an object that can be pushed, with friction on the ground."""
    origin, centre = ground.solid, ground.centres[number]
    mass = float(ground.masses[number])
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
        _add_shape(space, body, at, radius, _FIRST + number)
    force = float(ground.frictions.sliding[number]) * mass * _GRAVITY
    slide, spin = _friction(space.static_body, body, force, force * spread)
    space.add(slide, spin)
    return PushedObject(body, slide, spin, force, spread)


def _limit_friction(movable: PushedObject) -> None:
    """Divides friction between sliding and turning: an elliptic limit surface."""
    slid = movable.body.velocity.length
    spun = abs(movable.body.angular_velocity) * movable.spread
    speed = math.hypot(slid, spun)
    shares = (slid / speed, spun / speed) if speed > _STILL else (1.0, 1.0)
    force = movable.max_force
    movable.slide.max_force = force * max(shares[0], _LEAST)
    movable.spin.max_force = force * movable.spread * max(shares[1], _LEAST)


def _friction(one: Any, other: Any, force: float, torque: float) -> list[Any]:
    """Joints that stop the relative motion of two bodies with limited force."""
    at = other.position
    slide = pymunk.PivotJoint(one, other, one.world_to_local(at), (0.0, 0.0))
    spin = pymunk.GearJoint(one, other, 0.0, 1.0)
    for joint, limit in ((slide, force), (spin, torque)):
        joint.max_bias, joint.max_force = 0.0, limit
    return [slide, spin]


def _add_fixed(space: Any, solid: Prisms, state: Array) -> None:
    """Adds the fixed parts that the robot or an object might touch in a step."""
    movers = np.vstack(
        [[(state[0], state[1], BODY_RADIUS)], solid.extent[solid.owner != FIXED, :3]]
    )
    for part in np.flatnonzero(solid.owner == FIXED).tolist():
        x, y, reach = solid.extent[part, :3].tolist()
        off = np.hypot(movers[:, 0] - x, movers[:, 1] - y)
        if (off - movers[:, 2] - reach < _NEAR).any():
            radius = float(solid.extent[part, 3])
            outline = solid.outline(part)
            _add_shape(space, space.static_body, outline, radius, _FIXED)


def _add_shape(space: Any, body: Any, at: Array, radius: float, kind: int) -> None:
    if len(at) == 1:
        x, y = at[0].tolist()
        shape: Any = pymunk.Circle(body, radius, (x, y))
    else:
        shape = pymunk.Poly(body, [(x, y) for x, y in at.tolist()])
    shape.collision_type = kind
    space.add(shape)
