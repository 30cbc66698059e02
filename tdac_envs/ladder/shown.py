"""A task set as a person or a model reads it: lengths in the units it observes."""

from __future__ import annotations

from tdac_envs.ladder.robots import EPuckRobotParams
from tdac_envs.ladder.set_disturbances import LENGTHS
from tdac_envs.ladder.set_file import SetFile
from tdac_envs.mapping.params import RobotParams, converted_robot


def in_shown_units(file: SetFile) -> SetFile:
    """The set with its lengths in `shown_unit`; angles of a robot in metres turn left.

    It is for texts and `params.json`: what drives uses the set itself.
    """
    if file.resolution is None:
        return file
    length = file.units.written_length
    assert not isinstance(file.robot, EPuckRobotParams)
    robot = converted_robot(file.robot.written(), file.units, inwards=False)
    errors = {name: length(getattr(file.disturbances, name)) for name in LENGTHS}
    movers = tuple(
        group.model_copy(
            update={
                "speed": tuple(map(length, group.speed)),
                "radius": tuple(map(length, group.radius)),
            }
        )
        for group in file.movers
    )
    return file.model_copy(
        update={
            "robot": RobotParams.model_validate(robot),
            "goal_tolerance": length(file.goal_tolerance),
            "movers": movers,
            "disturbances": file.disturbances.model_copy(update=errors),
        }
    )
