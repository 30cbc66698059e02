"""What a robot of a task set observes, and what disturbs it, in words."""

from __future__ import annotations

import math
from collections.abc import Iterator

from tdac_envs.epuck.infrared import LARGEST, N_SENSORS, TABLE
from tdac_envs.epuck.observed import ENCODER_STEP
from tdac_envs.ladder.robots import EPuckRobotParams
from tdac_envs.ladder.set_file import SetFile
from tdac_envs.ladder.shown import in_shown_units
from tdac_envs.ladder.task_sets import TaskSet
from tdac_envs.mapping.params import RobotParams


def observation_rows(tasks: TaskSet) -> Iterator[str]:
    """Yields the rows of the table of observations."""
    file = in_shown_units(tasks.file)
    side = tasks.largest_side * file.per_unit
    rows = {**_places(file, side), **_readings(file)}
    for key in sorted(file.observed):
        yield f"| `{key}` | {' | '.join(rows[key])} |"


def _places(file: SetFile, side: float) -> dict[str, tuple[str, str, str, str]]:
    """Rows of what all robots observe, in worlds with sides of at most `side`."""
    unit = file.shown_unit
    decimals = 0 if unit == "px" else 2
    far = math.ceil(math.hypot(side, side) * 10**decimals) / 10**decimals
    low = -side / 2 if file.is_epuck else 0.0 if unit == "m" else -0.5
    if file.frame == "start":
        place, frame = f"-{far:g} to {far:g}", "start frame"
    else:
        place, frame = f"{low:g} to {low + side:g}", "frame of the map"
    odometry = "measured arc length (negative backwards) and turn of the last step"
    return {
        "pose": (
            "(3,)",
            f"{place}; heading in (-pi, pi]",
            f"{unit}, {unit}, rad",
            f"x, y, heading of the robot in the {frame}"
            + ("" if file.disturbances.reception.has_errors else "; exact"),
        ),
        "goal": (
            "(2,)",
            place,
            unit,
            f"x, y of the goal in the {frame}; constant in an episode, exact",
        ),
        "wheel_speeds": (
            "(2,)",
            "-1 to 1",
            "fraction",
            "command of the left and right wheel in the last step"
            + (", after the delay" if file.disturbances.delay else ""),
        ),
        "odometry": (
            "(2,)",
            "small",
            f"{unit}, rad",
            f"{odometry}; (0, 0) at the start",
        ),
    }


def _readings(file: SetFile) -> dict[str, tuple[str, str, str, str]]:
    """Rows of the sensors of a robot."""
    robot = file.robot
    if isinstance(robot, EPuckRobotParams):
        return {
            "ps": (
                f"({N_SENSORS},)",
                f"0 to {LARGEST:g}",
                "",
                "readings of the infra-red sensors ps0 to ps7",
            ),
            "encoders": (
                "(2,)",
                "-10000 to 10000",
                "rad",
                "angles that the left and right wheel have turned since the start, in "
                f"steps of {ENCODER_STEP:g} rad",
            ),
        }
    return {
        "ranges": (
            f"({robot.n_rays},)",
            f"0 to {robot.range_max:g}",
            file.shown_unit,
            f"distance from the {_origin(robot)} to the first obstacle along each ray",
        )
    }


def _origin(robot: RobotParams) -> str:
    return "robot's centre" if robot.scanner_offset is None else "scanner"


def disturbance_lines(file: SetFile) -> Iterator[str]:
    """Yields a line for each disturbance of the set: its distribution and size.

    Args:
        file: The set in the units that the robot observes.
    """
    own = file.disturbances
    low, high = 1.0 - own.wheel_gains, 1.0 + own.wheel_gains
    steps = _steps(own.delay)
    sizes_and_lines: list[tuple[float, str]] = [
        (
            own.wheel_gains,
            "Hidden wheel gains: each wheel turns at the command times "
            f"a gain of their own, each uniform in [{low:g}, {high:g}], drawn anew for "
            "each episode and constant in it; never faster than max_wheel_speed.",
        ),
        (
            own.axle_error,
            "Hidden axle length: axle_length times 1 + e, e uniform within "
            f"±{own.axle_error:g}, constant in an episode.",
        ),
        (
            own.wheel_slip,
            "Slip: in each step, the speed of each wheel over ground is multiplied by "
            f"a normal number with mean 1 and SD {file.slip:.3g}; again never faster "
            "than max_wheel_speed.",
        ),
        (
            own.motor_lag,
            f"Lag: wheel speeds follow the commands with a time constant of "
            f"{own.motor_lag:g} s.",
        ),
        (
            own.delay,
            f"Delay: an action takes effect {steps} late; until the first one does, "
            "the wheels stand still.",
        ),
        (
            own.range_noise,
            "Noise of the ranges: each ray in each step times a normal number with "
            f"mean 1 and SD {own.range_noise:g}, limited to [0, range_max].",
        ),
        (
            own.range_dropout,
            f"Dropouts: each ray reads range_max with probability "
            f"{own.range_dropout:g} in each step.",
        ),
        (
            own.odometry_scale,
            "Scale errors of the odometry: distance and turn are each multiplied by "
            f"1 + e, e normal with SD {own.odometry_scale:g}, one for distance and one "
            "for turn, drawn for each episode and constant in it.",
        ),
        (
            own.odometry_noise,
            "Noise of the odometry: distance and turn of each step are each multiplied "
            f"by a normal number with mean 1 and SD {own.odometry_noise:g}.",
        ),
    ]
    if isinstance(file.robot, EPuckRobotParams):
        sizes_and_lines += _epuck_errors(file.robot)
    else:
        sizes_and_lines += _map_errors(file)
    return (line for size, line in sizes_and_lines if size)


def _steps(count: int) -> str:
    return "1 step" if count == 1 else f"{count} steps"


def _map_errors(file: SetFile) -> list[tuple[float, str]]:
    own, dt, unit = file.disturbances, file.dt, file.shown_unit
    pose = f"SD {own.pose_noise:g} {unit} in x and in y"
    if own.heading_noise:
        pose += f" and {own.heading_noise:g} rad of the heading"
    lasting = "new in each step"
    if (time := own.pose_correlation) > 0.0:
        lasting = f"correlated over {time:g} s (by exp(-t / {time:g} s))"
    return [
        (
            own.wheel_radius_error,
            "Hidden wheel radii: each wheel drives 1 + e times as far, e uniform "
            f"within ±{own.wheel_radius_error:g}, drawn for each wheel, constant in an "
            "episode.",
        ),
        (
            own.max_acceleration,
            "Acceleration: a wheel's speed changes by at most "
            f"{own.max_acceleration:g} {unit}/s², which is "
            f"{own.max_acceleration * dt:g} {unit}/s in a step.",
        ),
        (
            own.range_min,
            f"Ranges below {own.range_min:g} {unit} read range_max.",
        ),
        (
            own.pose_noise or own.heading_noise,
            f"Errors of the pose: normal with {pose}, {lasting}.",
        ),
        (
            own.pose_jumps,
            f"Jumps of the pose: {own.pose_jumps:g} in a minute on average; its errors "
            "are drawn anew, three times as large, and decay.",
        ),
        (own.pose_delay, f"The pose is {_steps(own.pose_delay)} old."),
        (own.scan_delay, f"The ranges are {_steps(own.scan_delay)} old."),
        (
            own.message_drop,
            "Lost messages: with probability "
            f"{own.message_drop:g}, the pose and ranges of a step are those seen last.",
        ),
    ]


def _epuck_errors(robot: EPuckRobotParams) -> list[tuple[float, str]]:
    listed = ", ".join(
        f"{1e3 * distance:g}: {robot.sensor_noise * spread:.2g}"
        for distance, _, spread in TABLE.tolist()
    )
    return [
        (
            robot.wheel_radius_error,
            "Hidden wheel radii: each wheel's radius is wheel_radius times 1 + e, e "
            f"uniform within ±{robot.wheel_radius_error:g}, drawn for each wheel, "
            "constant in an episode; `encoders` do not show it.",
        ),
        (
            robot.sensor_noise,
            "Noise of the infra-red sensors: each reading in each step times a normal "
            "number with mean 1 and an SD that follows from the length of the ray "
            f"(mm: SD): {listed}, linearly in between; limited to [0, {LARGEST:g}].",
        ),
    ]
