"""Where the score of an episode was lost, as shares that add up to 1 - score."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.storage.printable_record import StrictRecord
from tdac_agent.verification.diagnosis.motion import ahead, arc_of, lengths, turns

IDLE = ("standing", "turning", "slower")
"""What a robot does with the rest of a step that it does not drive at full speed."""
_STILL = 0.05
"""Motion below this share of the fastest counts as none."""


class Losses(StrictRecord):
    """Shares of the score that an episode lost; together 1 - time score.

    After a success in T steps, each step costs 1/T. What is left of a step beyond its
    motion at full speed is lost by standing, turning on the spot, or driving slower.
    Of the path at full speed, what exceeds the least possible one is lost by reversing,
    up to the path in the rarer direction, and by a detour.
    """

    failure: float = Field(0.0, description="1 if the goal was not reached.")
    detour: float = Field(0.0, description="A longer path than the shortest one.")
    standing: float = Field(0.0, description="Steps almost without motion.")
    turning: float = Field(0.0, description="Turns on the spot.")
    slower: float = Field(0.0, description="Driving, but not at full speed.")
    reversing: float = Field(0.0, description="Driving forwards and backwards.")

    @property
    def total(self) -> float:
        """All of it."""
        return sum(self.by_cause.values())

    @property
    def by_cause(self) -> dict[str, float]:
        """The shares by cause, in the order of the fields."""
        return dict(self)


def losses_of(
    trajectory: Trajectory,
    full_step: float,
    full_turn: float,
    least_steps: float,
    *,
    success: bool,
) -> Losses:
    """Where an episode lost its score.

    Args:
        trajectory: The episode, in units of its environment.
        full_step: Distance driven in a step at full speed, px or m.
        full_turn: Angle turned in a step on the spot at full speed, rad.
        least_steps: OT, the least number of steps in which any drive reaches the goal.
        success: Whether the goal was reached without contact.
    """
    steps = trajectory.steps
    if not success:
        return Losses(failure=1.0)
    if steps <= least_steps:
        return Losses()
    used, kinds = used_and_kinds(trajectory, full_step, full_turn)
    rest = 1.0 - np.abs(used)
    idle = {name: float(rest[kinds == name].sum()) for name in IDLE}
    beyond = float(np.abs(used).sum()) - least_steps
    # A robot may drive backwards all the way; changing between the two is lost.
    ways = (float(np.abs(used[used * sign > 0.0]).sum()) for sign in (1.0, -1.0))
    lost = {**idle, "reversing": min(*ways, max(beyond, 0.0))}
    if beyond < 0.0:  # a way at the very limit: only rest is lost
        whole = sum(idle.values())
        lost = {
            name: each * (steps - least_steps) / whole for name, each in idle.items()
        }
    shares = {name: round(each / steps, 9) for name, each in lost.items()}
    score = least_steps / steps
    detour = 1.0 - score - sum(shares.values()) if beyond > 0.0 else 0.0
    return Losses(**shares, detour=max(detour, 0.0))


def used_and_kinds(
    trajectory: Trajectory, full_step: float, full_turn: float
) -> tuple[NDArray[np.float64], NDArray[np.str_]]:
    """How much of its full speed each step used, and what it did with the rest.

    Returns:
        Shares of the fastest motion, in [-1, 1], negative backwards; and one of `IDLE`
        for each step.
    """
    turn = turns(trajectory)
    arc = arc_of(lengths(trajectory), turn)
    signed = np.copysign(arc, ahead(trajectory))
    used = np.clip(signed / full_step, -1.0, 1.0)
    slow = np.abs(used) < _STILL
    kinds = np.where(slow, "standing", "slower")
    kinds[slow & (np.abs(turn) >= _STILL * full_turn)] = "turning"
    return used, kinds
