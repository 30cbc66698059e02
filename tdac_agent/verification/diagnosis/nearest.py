"""The record of an episode's smallest gap, with the name of what was nearest."""

from __future__ import annotations

from tdac_agent.episodes.trajectory import Rollout
from tdac_agent.tasks.setting import Nominal
from tdac_agent.verification.diagnosis.gap import Gap
from tdac_agent.verification.diagnosis.surroundings import surroundings_of
from tdac_envs.drive.smallest_gap import SmallestGap
from tdac_envs.drive.task import Pose

_DIGITS = 9
_ANGLE_DIGITS = 4
_BESIDE = 3.0
"""What is named lies at most this much beyond the gap, in units of the screen."""


def gap_of(rollout: Rollout, task: Nominal, *, told: bool = True) -> Gap | None:
    """The smallest gap of an episode; None if it was not driven.

    Args:
        rollout: The episode.
        task: Its task.
        told: Whether the place may be told.
    """
    found, close = rollout.smallest_gap, rollout.close_gap
    if found is None:
        return None
    gap = _recorded(found, rollout, task, told)
    if close is None:
        return gap
    near = gap if close == found else _recorded(close, rollout, task, told)
    return gap.model_copy(update={"close": near})


def _recorded(found: SmallestGap, rollout: Rollout, task: Nominal, told: bool) -> Gap:
    gap = Gap(
        gap=round(found.gap, _DIGITS),
        radii=round(found.gap / rollout.radius, _ANGLE_DIGITS),
        required=round(rollout.required_gap, _DIGITS),
    )
    if not told:
        return gap
    place = {
        "step": found.step,
        "x": round(found.x, _DIGITS),
        "y": round(found.y, _DIGITS),
        "heading": round(found.heading, _ANGLE_DIGITS),
        "thing": _nearest(found, rollout, task),
    }
    return gap.model_copy(update=place)


def _nearest(found: SmallestGap, rollout: Rollout, task: Nominal) -> str | None:
    """Name of what was nearest at a gap."""
    if found.mover is not None:
        return f"mover {found.mover}"
    around = surroundings_of(task)
    (pose,) = around.units.on_screen([(found.x, found.y, found.heading)]).tolist()
    reach = (rollout.radius + found.gap) * around.units.scale + _BESIDE
    touch = around.touch(Pose(*pose), reach)
    return None if touch is None else touch.thing
