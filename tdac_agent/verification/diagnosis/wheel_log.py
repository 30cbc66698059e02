"""What drives show of the wheels: delay, gains, scatter, and the sizes of a step."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.tasks.setting import Nominal
from tdac_agent.tasks.units import Units
from tdac_agent.verification.diagnosis.motion import ahead, arc_of, turns

LATEST = 6
"""Most delay that is looked for, steps."""
LEAST_SUM = 8.0
"""Least sum of squared commands of an episode from which gains follow."""
LEAST_JUMPS = 10
_EXACT = 0.01
_JUMP = 0.8
"""A change of a command that shows how fast a wheel follows."""
_FOLLOWS = 0.6
"""A change of a wheel's speed in a step that is no limit."""


class _Sums(NamedTuple):
    """Sums over the steps of an episode for each delay; shape (LATEST + 1, 2 wheels).

    Attributes:
        commands: Sum of squared commands.
        products: Sum of commands times the speeds that the wheels had.
        speeds: Sum of squared speeds.
    """

    commands: NDArray[np.float64]
    products: NDArray[np.float64]
    speeds: NDArray[np.float64]


@dataclass(slots=True)
class WheelLog:
    """Adds up over episodes of one robot.

    Attributes:
        step: Distance of a step at full speed, in units of the environment.
        turn: Turn on the spot of a step at full speed, rad.
    """

    step: float = 0.0
    turn: float = 0.0
    _episodes: list[_Sums] = field(default_factory=list)
    _changes: list[float] = field(default_factory=list)

    def add(self, trajectory: Trajectory, task: Nominal, *, up: bool) -> None:
        """Adds an episode.

        Args:
            trajectory: The episode, in units of its environment.
            task: Its task.
            up: Whether headings of the environment are counter-clockwise.
        """
        self.step = task.full_step
        self.turn = 2.0 * task.full_step / task.axle_length
        # A contact ends the last step early.
        end = trajectory.steps - (trajectory.collisions > 0)
        if end < 2:
            return
        speeds = wheel_speeds(trajectory, task, up=up)[:end]
        commands = trajectory.actions[:end].astype(np.float64)
        sums = np.zeros((3, LATEST + 1, 2))
        sums[2] = (speeds**2).sum(axis=0)
        for late in range(min(LATEST, end - 1) + 1):
            given = np.vstack([np.zeros((late, 2)), commands[: end - late]])
            sums[0, late] = (given**2).sum(axis=0)
            sums[1, late] = (given * speeds).sum(axis=0)
        self._episodes.append(_Sums(*sums))
        jumps = np.abs(np.diff(commands, axis=0)) >= _JUMP
        changes = np.abs(np.diff(speeds, axis=0))
        # The largest change soon after a jump, however late it acts.
        for step, wheel in np.argwhere(jumps).tolist():
            self._changes.append(float(changes[step : step + LATEST, wheel].max()))

    def lines(self, units: Units) -> list[str]:
        """One line for each figure; none before enough was driven.

        Args:
            units: Units and frame that the controller observes.
        """
        driven = [each for each in self._episodes if each.commands.min() >= LEAST_SUM]
        if not driven:
            return []
        commands, products, speeds = (
            np.sum([each[i] for each in driven], axis=0) for i in range(3)
        )
        rest = (speeds - products**2 / commands).sum(axis=1)
        late = int(rest.argmin())
        scatter = math.sqrt(max(float(rest[late]), 0.0) / commands[late].sum())
        when = "in the same step" if late == 0 else _late(late)
        own = np.array([each.products[late] / each.commands[late] for each in driven])
        gain = float((products[late] / commands[late]).mean())
        lines = [f"a command acts {when}", *self._sizes(gain, units)]
        low, high = own.min(axis=0), own.max(axis=0)
        if (high - low).max() > 2.0 * _EXACT:
            lines.append(
                "speed of a wheel divided by its command, in single episodes: left "
                f"{low[0]:.2f} to {high[0]:.2f}, right {low[1]:.2f} to {high[1]:.2f}"
            )
        if scatter > _EXACT:
            lines.append(
                "beyond that, the speed of a wheel in a step differs from its command "
                f"by {100.0 * scatter:.0f} % of the command (SD)"
            )
        if len(self._changes) >= LEAST_JUMPS:
            most = float(np.quantile(self._changes, 0.9))
            if most < _FOLLOWS:
                lines.append(
                    f"a wheel's speed changes by at most {100.0 * most:.0f} % of full "
                    "speed in a step"
                )
        return lines

    def _sizes(self, gain: float, units: Units) -> list[str]:
        """Length and turn of a step at full speed; a turn as it is observed."""
        # As an observed heading changes when the robot turns to the right.
        change = math.remainder(units.heading_of(0.1) - units.heading_of(0.0), math.tau)
        angle = math.copysign(math.degrees(self.turn * gain), change * gain)
        return [
            f"command (1, 1) drives {units.figure(self.step * gain)} ahead in a step",
            f"command (1, -1) changes the heading by {angle:+.1f}° in a step, on the "
            "spot",
        ]


def _late(steps: int) -> str:
    return f"{steps} step{'s' * (steps > 1)} late"


def wheel_speeds(
    trajectory: Trajectory, task: Nominal, *, up: bool
) -> NDArray[np.float64]:
    """Speeds that the wheels had, from the motion; shape (T, 2), 1 is full speed.

    Args:
        trajectory: The episode, in units of its environment.
        task: Its task.
        up: Whether headings are counter-clockwise.
    """
    turn = turns(trajectory)
    arc = arc_of(ahead(trajectory), turn)
    right = -turn if up else turn
    half = right * task.axle_length / 2.0
    return np.stack([arc + half, arc - half], axis=1) / task.full_step
