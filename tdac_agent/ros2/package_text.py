"""What the texts of an exported package say of it."""

from __future__ import annotations

import math
import platform
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tdac_agent.ros2.package.scans import Guard
from tdac_agent.ros2.package.settings import LATENCY, LOST, PERIODS, usual_deviation

NOT_RUN = (
    "The node was driven with rclpy of ROS 2 Jazzy in a simulation, but on no robot."
)
SMOOTHER = 2.5, 3.2
"""Default accelerations of Nav2's velocity smoother, m/s² and rad/s²."""
MAINTAINER = {"maintainer": "maintainer", "email": "maintainer@example.com"}


@dataclass(frozen=True, slots=True)
class RosPackage:
    """An exported package.

    Attributes:
        folder: Folder of the package.
        name: Name of the package.
        verified: Whether its controller is verified.
        verdict: The verdict in a sentence.
        stops: Distances to standstill by cause, m.
        unknown: What the map's unknown cells are, in a sentence.
        reach: Radius and smallest gap of the verified drives, m: a body that reaches so
            far from the middle of its axle touched nothing of the map. None if no gap
            is on record.
    """

    folder: Path
    name: str
    verified: bool
    verdict: str
    stops: dict[str, float]
    unknown: str
    reach: float | None


def values_of(made: RosPackage, settings: dict[str, Any]) -> dict[str, Any]:
    """What the templates say; nothing of it names a place of this machine."""
    robot, dt = settings["robot"], settings["dt"]
    word, warning, verdict = "verified", "", made.verdict
    if not made.verified:
        word, warning = "exported", "NOT VERIFIED. "
        verdict = f"**Not verified.** {made.verdict}"
    speed = min(robot["max_wheel_speed"], robot.get("max_speed") or math.inf)
    way = "with" if robot["is_scanner"] else "of any scanner, resampled to"
    return {
        **MAINTAINER,
        "name": made.name,
        # A name may have any printable characters, such as those of Markdown.
        "task": re.sub(r"[^\w .,+-]", "_", settings["task"]),
        "verdict": verdict,
        "word": word,
        "short": f"{warning}Drives {made.name} with a {word} controller",
        "description": f"{warning}Drives a robot to a goal on a known map with a "
        f"controller written and judged by tdac (SHA-256 "
        f"{settings['controller_sha256']}). {made.verdict} {made.unknown} {NOT_RUN}",
        "sha256": settings["controller_sha256"],
        "robot": robot,
        "full": f"{speed:g}",
        "rate": f"{1 / dt:g}",
        "limit": f"{PERIODS * dt:g}",
        "period": f"{dt:g}",
        "deviation": f"{usual_deviation(robot):.3g}",
        "lost": f"{LOST:g}",
        "unknown": made.unknown,
        "reach": "" if made.reach is None else f"{made.reach:.3f}",
        "error": f"{_range_error(robot):.3f}",
        "full_float": round(float(speed), 4),
        "omega_float": round(_turn_rate(robot), 4),
        "brakes": float(robot.get("max_acceleration") or SMOOTHER[0]),
        "omega": f"{_turn_rate(robot):.3g}",
        "turns_on": f"{_turns_on(robot, dt):.2g}",
        "watched": f"{speed * (PERIODS + 2) * dt + robot['stopping_distance']:.3f}",
        "turn_brakes": float(robot.get("max_turn_acceleration") or SMOOTHER[1]),
        "timer": f"{1.8 * dt:g}",
        "start": [f"{value:g}" for value in settings["start"]],
        "goal": [f"{value:g}" for value in settings["goal"]],
        "scanner": f"{way} {_fan_text(robot['ray_angles'])}, up to "
        f"{robot['range_max']:g} m",
        "stops": made.stops,
        "numpy": np.__version__,
        "python": platform.python_version(),
    }


def _range_error(robot: dict[str, Any]) -> float:
    """What the stop ahead adds for the error of a range, m."""
    return Guard(robot, 0.0).error


def _turn_rate(robot: dict[str, Any]) -> float:
    """The largest turn rate of a robot, rad/s."""
    full = 2.0 * robot["max_wheel_speed"] / robot["axle_length"]
    return float(min(full, robot.get("max_turn_rate") or math.inf))


def _turns_on(robot: dict[str, Any], dt: float) -> float:
    """How far a turn at full rate goes on after a stop, with the latency, rad."""
    omega = _turn_rate(robot)
    brakes = robot.get("max_turn_acceleration")
    while_braking = 0.0 if not brakes else 0.5 * omega**2 / brakes
    return omega * (1 + LATENCY) * dt + while_braking


def _fan_text(angles: list[float]) -> str:
    """The rays in words: how many, and from where to where."""
    first, last = (math.degrees(angles[i]) for i in (0, -1))
    if len(angles) == 1:
        return f"1 ray at {first:.4g}°"
    turn = math.remainder(angles[1] - angles[0], math.tau)
    way = "counter-clockwise" if turn > 0 else "clockwise"
    return (
        f"{len(angles)} rays from {first:.4g}° {way} to {last:.4g}° (left is positive)"
    )
