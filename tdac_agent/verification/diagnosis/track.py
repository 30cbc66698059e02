"""The pieces of a track on which an episode lost most of its time, in words."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.tasks.parts import Surroundings
from tdac_agent.tasks.setting import Nominal
from tdac_agent.tasks.units import Points, Units
from tdac_agent.verification.diagnosis.losses import IDLE, used_and_kinds
from tdac_agent.verification.diagnosis.motion import lengths
from tdac_agent.verification.diagnosis.surroundings import (
    surroundings_of,
    trajectory_on_screen,
)
from tdac_envs.drive.task import Pose

MOST_PIECES = 3
LEAST_LOST = 5.0
"""Steps that a piece must have lost to be told."""
_APART = 4
"""Pieces of a kind with at most so many other steps in between are one."""
_SLOW = 0.8
"""Driving below this share of full speed is slow."""
_NEAR = 5.0
"""Obstacles within so many body radii are named."""
_PARTED = 2.0
"""Tracks that are this many body radii apart have parted."""


class Piece(NamedTuple):
    """A piece of a track.

    Attributes:
        kind: `standing`, `turning`, `slower`, or `detour`: away from the goal and back.
        first: Its first step.
        last: The step after its last one.
        lost: Steps that it lost.
    """

    kind: str
    first: int
    last: int
    lost: float


def pieces_of(
    trajectory: Trajectory, full_step: float, full_turn: float
) -> list[Piece]:
    """The pieces of a track that lost most steps, in order; at most `MOST_PIECES`.

    Pieces do not overlap: what is idle during a detour is told as part of it.

    Args:
        trajectory: The episode, in units of its environment.
        full_step: Distance driven in a step at full speed.
        full_turn: Angle turned in a step on the spot at full speed, rad.
    """
    used, kinds = used_and_kinds(trajectory, full_step, full_turn)
    rest = 1.0 - np.abs(used)
    kinds = np.where(rest <= 1.0 - _SLOW, "", kinds)
    found = _detours(trajectory, full_step)
    for piece in found:
        kinds[piece.first : piece.last] = ""
    for kind in IDLE:
        found += [
            Piece(kind, first, last, float(rest[first:last].sum()))
            for first, last in _runs(kinds == kind)
        ]
    worst = sorted(found, key=lambda piece: -piece.lost)[:MOST_PIECES]
    told = [piece for piece in worst if piece.lost >= LEAST_LOST]
    return sorted(told, key=lambda piece: piece.first)


def _detours(trajectory: Trajectory, full_step: float) -> list[Piece]:
    """Stretches in which the path to the goal got longer, until it was made up for."""
    left = trajectory.path_distances
    least = np.minimum.accumulate(left)
    behind = left > least + 2.0 * full_step
    found = []
    for first, last in _runs(behind, apart=0):
        begin = int(np.flatnonzero(left[: first + 1] <= least[first])[-1])
        after = np.flatnonzero(left[last:] <= least[first])
        end = last + int(after[0]) if len(after) else len(left) - 1
        found.append(Piece("detour", begin, end, float(end - begin)))
    return _disjoint(found)


def _disjoint(pieces: list[Piece]) -> list[Piece]:
    """The pieces without those that begin inside of an earlier one."""
    kept: list[Piece] = []
    for piece in pieces:
        if not kept or piece.first >= kept[-1].last:
            kept.append(piece)
    return kept


def _runs(flags: NDArray[np.bool_], apart: int = _APART) -> list[tuple[int, int]]:
    """First step, and step after the last one, of each run of set flags."""
    places = np.flatnonzero(flags)
    if not len(places):
        return []
    breaks = np.flatnonzero(np.diff(places) > apart + 1)
    firsts = places[np.concatenate([[0], breaks + 1])]
    lasts = places[np.concatenate([breaks, [len(places) - 1]])] + 1
    return list(zip(firsts.tolist(), lasts.tolist(), strict=True))


def told_pieces(trajectory: Trajectory, task: Nominal, shown: Units) -> list[str]:
    """The pieces of a track in words, one line each.

    Args:
        trajectory: The episode, in units of its environment.
        task: Its task.
        shown: Units and frame that the controller observes.
    """
    full_turn = 2.0 * task.full_step / task.axle_length
    found = pieces_of(trajectory, task.full_step, full_turn)
    around = surroundings_of(task, shown)
    on_screen = trajectory_on_screen(trajectory, shown)
    return [_told(piece, on_screen, around) for piece in found]


def _told(piece: Piece, trajectory: Trajectory, around: Surroundings) -> str:
    places, units = trajectory.poses[piece.first : piece.last + 1], around.units
    begin, end = (units.point(*places[i, :2].tolist()) for i in (0, -1))
    seconds = (piece.last - piece.first) * trajectory.dt
    when = f"steps {piece.first} to {piece.last} ({seconds:.1f} s)"
    if piece.kind == "detour":
        left = trajectory.path_distances[piece.first : piece.last + 1]
        far = units.point(*places[int(left.argmax()), :2].tolist())
        back = "and back" if left[-1] <= left[0] else "and not back"
        return f"{when}: away from the goal {back}, from {begin} by way of {far}"
    near = _nearest(places[len(places) // 2], around)
    if piece.kind == "standing":
        return f"{when}: stood at {begin}{near}"
    if piece.kind == "turning":
        turned = abs(float(np.ptp(np.unwrap(places[:, 2]))))
        return (
            f"{when}: turned on the spot by {np.degrees(turned):.0f}° at {begin}{near}"
        )
    length = float(lengths(trajectory)[piece.first : piece.last].sum())
    share = length / max(around.full_speed * seconds, 1e-9)
    speed = f"{100.0 * share:.0f} % of full speed"
    return f"{when}: drove at {speed} from {begin} to {end}{near}"


def _nearest(pose: NDArray[np.float64], around: Surroundings) -> str:
    touch = around.touch(Pose(*pose.tolist()), _NEAR * around.radius)
    if touch is None:
        return ", with no wall near"
    return f", with {around.units.far(touch.gap)} between body and {touch.thing}"


def told_sibling(
    trajectory: Trajectory, sibling: Trajectory, task: Nominal, shown: Units
) -> str:
    """Where the track of another candidate parts from one, and to which side.

    Args:
        trajectory: The episode, in units of its environment.
        sibling: That of the other candidate, in the same world.
        task: Its task.
        shown: Units and frame that the controller observes.
    """
    own, other = (trajectory_on_screen(each, shown) for each in (trajectory, sibling))
    far = _PARTED * surroundings_of(task, shown).radius
    step = _parting(own.poses, other.poses, far)
    if step is None:
        return "on the same way"
    near = int(_distances(own.poses[:, :2], other.poses[step, :2]).argmin())
    x, y, heading = own.poses[near].tolist()
    dx, dy = (other.poses[step, :2] - (x, y)).tolist()
    side = "right" if np.cos(heading) * dy - np.sin(heading) * dx > 0.0 else "left"
    place = shown.point(x, y)
    return f"on another way: it parts from this one at {place}, to the {side}"


def _parting(own: Points, other: Points, far: float) -> int | None:
    """The first step of a track at which it is far from another one."""
    for step, pose in enumerate(other[:, :2]):
        if _distances(own[:, :2], pose).min() > far:
            return step
    return None


def _distances(places: Points, place: Points) -> NDArray[np.float64]:
    return np.asarray(np.hypot(*(places - place).T))
