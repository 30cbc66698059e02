"""What a prompt says of a robot's limits and scanner."""

from __future__ import annotations

from tdac_envs.grid.map_units import MapUnits
from tdac_envs.mapping.params import RobotParams

_BELOW = {
    "range_max": "`range_max`",
    "range_min": "`range_min`",
    "zero": "0",
}


def robot_lines(robot: RobotParams, units: MapUnits) -> list[str]:
    """Returns a sentence for each limit that not every robot has.

    Args:
        robot: The robot, in px.
        units: Units of the sentences.
    """
    length = units.length
    lines = []
    if robot.max_speed or robot.max_turn_rate:
        limits = [
            *([f"{length(robot.max_speed, 3)}/s"] if robot.max_speed else []),
            *([f"{robot.max_turn_rate:g} rad/s"] if robot.max_turn_rate else []),
        ]
        lines.append(
            f"The body drives at most {' and turns at most '.join(limits)}: a faster "
            "command is scaled down, both wheels by the same factor."
        )
    if robot.max_acceleration:
        lines.append(
            f"A wheel accelerates by at most {length(robot.max_acceleration, 3)}/s² "
            "(`wheel_speeds` shows the speed that it has)."
        )
    if robot.max_turn_acceleration:
        lines.append(
            f"The turn accelerates by at most {robot.max_turn_acceleration:g} rad/s²."
        )
    if robot.stopping_distance:
        lines.append(
            f"It needs {length(robot.stopping_distance, 3)} to stop from full speed, "
            "and should keep this gap to obstacles where the map allows it."
        )
    if robot.range_min:
        lines.append(
            f"A ray that meets a surface nearer than {length(robot.range_min, 3)} "
            f"reads {_BELOW[robot.below_min or 'range_max']}."
        )
    if robot.scanner_offset:
        ahead, aside = robot.scanner_offset
        side = "left" if aside < 0 else "right"
        lines.append(
            f"The rays start {length(abs(ahead), 3)} "
            f"{'ahead of' if ahead >= 0 else 'behind'} the centre"
            + (f" and {length(abs(aside), 3)} to its {side}." if aside else ".")
        )
    return lines
