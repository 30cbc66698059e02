"""Why an episode without a contact did not arrive: cause, step and figures."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tdac_agent.motion import (
    find_returns,
    flips,
    forward,
    lengths,
    rounds_about,
    swing,
    turns,
    wheels_differ,
    wheels_turn,
)
from tdac_agent.report import Cause
from tdac_agent.trajectory import Rollout, Trajectory
from tdac_envs.task2d import Map2DTask

# A step nearer than this, px, is no progress: it is what a turn in place drifts.
PROGRESS = 1.0
# Share of the episode without progress from which a robot is not merely slow.
_STALLED = 0.2
# Share of steps that reverse a turn or a drive: a period of 40 steps (2 s) or less.
_FLIPS = 0.05
# Share of the places that a robot passed before, from which it goes over its trail.
_AGAIN = 0.6
# The largest circle that counts as spinning, radii of the body.
_CIRCLE = 4.0
# Rounds in the second half of the time without progress that count as spinning.
_ROUNDS = 1.0
# Mean wheel speed below which a robot does nothing on purpose.
_IDLE = 0.01
# Steps that a robot may trail off before it stands.
_AT_ONCE = 10


class Finding(NamedTuple):
    """What happened, with the step of it."""

    cause: Cause
    text: str
    step: int


def why_no_arrival(rollout: Rollout, task: Map2DTask) -> Finding:
    """What kept a robot from its goal that touched nothing."""
    trajectory = rollout.trajectory
    gone = np.hypot(*(trajectory.poses[:, :2] - trajectory.poses[0, :2]).T).max()
    if gone < PROGRESS and np.abs(turns(trajectory)).sum() < 1.0:
        text = f"in {trajectory.steps} steps it went {gone:.1f} px from its start"
        return Finding("no motion", f"{text} and hardly turned.", 0)
    since = last_progress(rollout)
    if rollout.reached or trajectory.steps - since < _STALLED * trajectory.steps:
        return _unfinished(trajectory, task)
    return (
        _missed_goal(rollout, since)
        or _wrong_goal(rollout, task)
        or _stalled(trajectory, since, rollout.radius)
    )


def near_goal(rollout: Rollout) -> float:
    """Path left from which a robot has come to its goal without reaching it, px."""
    d0 = float(rollout.trajectory.path_distances[0])
    near = 3.0 * max(rollout.tolerance, rollout.radius)
    return min(near, max(0.25 * d0, 1.5 * rollout.tolerance))


def last_progress(rollout: Rollout) -> int:
    """Step after which a robot hardly came nearer to its goal."""
    distances = rollout.trajectory.path_distances
    progress = float(distances[0] - distances.min())
    # What creeps, or trembles, does not get on.
    slack = max(PROGRESS, min(0.05 * progress, 0.5 * rollout.radius))
    return int(np.argmax(distances <= float(distances.min()) + slack))


def standing_since(trajectory: Trajectory) -> int:
    """First step of the rest at the end of an episode; T where it moved to the end.

    Whoever trembles on the spot does not stand.
    """
    x, y, heading = trajectory.poses.T
    moved = np.hypot(x - x[-1], y - y[-1]) > 0.5 * PROGRESS
    moved |= np.abs(np.unwrap(heading) - np.unwrap(heading)[-1]) > 0.05
    moved[:-1] |= wheels_turn(trajectory)
    return int(np.flatnonzero(moved)[-1]) + 1 if moved.any() else 0


def _unfinished(trajectory: Trajectory, task: Map2DTask) -> Finding:
    """Still under way at the end of its time."""
    distances, steps = trajectory.path_distances, trajectory.steps
    limit = task.robot.max_wheel_speed
    driven, seconds = float(lengths(trajectory).sum()), steps * trajectory.dt
    speed = float(np.abs(forward(trajectory)).mean())
    facts = (
        f"{percent(1 - distances[-1] / max(distances[0], 1e-9))} of the way in {steps} "
        f"steps, at {limit * speed:.1f} px/s on average ({percent(speed)} of the wheel "
        f"limit), {distances[0] / seconds:.1f} px/s or more were needed; {driven:.0f} "
        f"px driven for {distances[0] - distances[-1]:.0f} px of progress; both wheels "
        f"stood in {percent(1 - wheels_turn(trajectory).mean())} of the steps."
    )
    reversed_share = flips(trajectory, 0)
    spin = float(np.abs(np.diff(trajectory.actions, axis=1)).mean()) / 2.0
    if reversed_share >= 5 * _FLIPS and spin >= 0.3:
        text = "it reversed its turn or its drive in "
        text += f"{percent(reversed_share)} of the steps and made {facts}"
        return Finding("oscillating", text, steps)
    return Finding("too slow", facts, steps)


def _missed_goal(rollout: Rollout, since: int) -> Finding | None:
    """It came near to its goal, and did not get there."""
    trajectory, straight = rollout.trajectory, rollout.distances("euclidean")
    distances = trajectory.path_distances
    within = straight <= rollout.tolerance
    if within.any():
        step = int(np.argmax(within))
        text = (
            f"in step {step} it was {straight[step]:.1f} px from the goal, within the "
            f"tolerance of {rollout.tolerance:.1f} px, but a wall stands in between: "
            f"the way there is {distances[step]:.1f} px."
        )
        return Finding("missed goal", text, step)
    if distances[since] > near_goal(rollout):
        return None
    best = int(np.argmin(distances))
    after = _after_the_goal(rollout, since, best)
    if after is None:
        return None
    step, what = after
    text = (
        f"in step {best} it was {straight[best]:.1f} px from the goal, tolerance "
        f"{rollout.tolerance:.1f} px; {what}."
    )
    return Finding("missed goal", text, step)


def _after_the_goal(rollout: Rollout, since: int, best: int) -> tuple[int, str] | None:
    """What a robot did after it had been nearest to its goal, if that is clear.

    Returns:
        The step to look at, and the words.
    """
    trajectory, straight = rollout.trajectory, rollout.distances("euclidean")[since:]
    rounds = rounds_about(trajectory, since, rollout.goal)
    away = float(trajectory.path_distances[-1] - trajectory.path_distances[best])
    if abs(rounds) >= 2.0 and straight.max() < 4.0 * near_goal(rollout):
        way = "clockwise" if rounds > 0 else "counter-clockwise"
        return best, (
            f"since step {since} it circled the goal {abs(rounds):.1f} times, {way} on "
            f"the picture, {straight.min():.1f} to {straight.max():.1f} px from it"
        )
    rest = standing_since(trajectory)
    if straight[-1] <= near_goal(rollout) and rest < trajectory.steps:
        text = f"it stands since step {rest} at {point(*trajectory.poses[-1, :2])}, "
        return rest, f"{text}{straight[-1]:.1f} px from the goal"
    if away > 2.0 * rollout.radius:
        return best, f"it then passed by and went {away:.1f} px away"
    return None


def _wrong_goal(rollout: Rollout, task: Map2DTask) -> Finding | None:
    """It ended where the goal is for one who mixes up the coordinates."""
    trajectory, grid, (x, y) = rollout.trajectory, task.terrain.grid, rollout.goal
    mistakes = {
        "x and y swapped": (y, x),
        "y counted from the lower side of the map": (x, grid.height - 1 - y),
        "x counted from the right side of the map": (grid.width - 1 - x, y),
    }
    final = trajectory.poses[-math.ceil(_STALLED * trajectory.steps) :, :2]
    start = trajectory.poses[0, :2]
    for mistake, place in mistakes.items():
        off = float(np.hypot(*(final - place).T).max())
        apart = min(math.dist(place, rollout.goal), math.dist(place, start))
        if off <= rollout.tolerance + rollout.radius < apart:
            text = (
                f"it ended within {off:.1f} px of {point(*place)}, which is the goal "
                f"{point(x, y)} with {mistake}."
            )
            return Finding("wrong goal", text, trajectory.steps)
    return None


def _stalled(trajectory: Trajectory, since: int, radius: float) -> Finding:
    """No progress since a step: standing, spinning, oscillating, looping or stuck."""
    rest = standing_since(trajectory)
    if trajectory.steps - rest >= 0.5 * (trajectory.steps - since):
        text = f"it stands at {point(*trajectory.poses[-1, :2])} since step {rest}"
        if rest - since > _AT_ONCE:
            text += f", and made no progress since step {since}"
        return Finding("stuck", f"{text}.", rest)
    # The first half may still be on the way to what the robot then did for good.
    late = since + (trajectory.steps - since) // 2
    cause, text = (
        _spinning(trajectory, late, radius)
        or _going_over_its_trail(trajectory, since, late, radius)
        or _trembling(trajectory, late, radius)
        or _wandering(trajectory, late)
    )
    place = point(*trajectory.poses[since, :2])
    return Finding(cause, f"no progress since step {since} at {place}; {text}.", since)


Habit = tuple[Cause, str]


def _spinning(trajectory: Trajectory, late: int, radius: float) -> Habit | None:
    turned = turns(trajectory)[late:]
    net, total = float(turned.sum()), float(np.abs(turned).sum())
    rounds, driven = abs(net) / math.tau, float(lengths(trajectory)[late:].sum())
    small = driven <= rounds * math.tau * _CIRCLE * radius
    if rounds < _ROUNDS or abs(net) < 0.7 * total or not small:
        return None
    way = "right" if net > 0 else "left"
    circle = driven / (rounds * math.tau)
    where = f"on a circle of {circle:.0f} px" if circle >= PROGRESS else "in place"
    return "spinning", (
        f"in the last {trajectory.steps - late} steps it turned {rounds:.1f} times to "
        f"the {way} {where}"
    )


def _trembling(trajectory: Trajectory, late: int, radius: float) -> Habit | None:
    turned, share = turns(trajectory)[late:], flips(trajectory, late)
    actions = np.abs(trajectory.actions[late:])
    if abs(turned.sum()) >= 0.3 * max(np.abs(turned).sum(), 1.0):
        return None
    if share < _FLIPS and not _looking_about(trajectory, late, radius):
        return None
    if actions.mean() < _IDLE:
        return None
    return "oscillating", (
        f"in the last {trajectory.steps - late} steps it reversed its turn or its "
        f"drive every {1 / share:.1f} steps, its heading within "
        f"{math.degrees(swing(trajectory, late)):.0f}°, its place within "
        f"{_extent(trajectory, late):.1f} px"
    )


def _looking_about(trajectory: Trajectory, late: int, radius: float) -> bool:
    """Whether a robot turns to and fro on the spot most of the time."""
    reversals = flips(trajectory, late) * (trajectory.steps - late)
    turning = wheels_differ(trajectory)[late:].mean()
    return reversals >= 4 and turning >= 0.5 and _extent(trajectory, late) < 3 * radius


def _going_over_its_trail(
    trajectory: Trajectory, since: int, late: int, radius: float
) -> Habit | None:
    if _extent(trajectory, late) < 3.0 * radius:
        return None
    (x0, y0), (x1, y1) = _box(trajectory, since)
    again = find_returns(trajectory, since, radius)
    if again.same_way < _AGAIN:
        return None
    cause: Cause = "oscillating" if again.other_way >= _AGAIN else "looping"
    how = "to and fro" if cause == "oscillating" else "in rounds"
    return cause, (
        f"since then it drove {how} over its own trail, every {again.period} steps the "
        f"same, within x {x0:.0f} to {x1:.0f}, y {y0:.0f} to {y1:.0f}"
    )


def _wandering(trajectory: Trajectory, late: int) -> Habit:
    (x0, y0), (x1, y1) = _box(trajectory, late)
    driven = float(lengths(trajectory)[late:].sum())
    return "stuck", (
        f"in the last {trajectory.steps - late} steps it drove {driven:.1f} px within "
        f"x {x0:.1f} to {x1:.1f}, y {y0:.1f} to {y1:.1f}"
    )


def _box(
    trajectory: Trajectory, since: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The least and the greatest (x, y) since a step."""
    places = trajectory.poses[since:, :2]
    return places.min(axis=0), places.max(axis=0)


def _extent(trajectory: Trajectory, since: int) -> float:
    """Diagonal of the box around all places since a step, px."""
    low, high = _box(trajectory, since)
    return float(np.hypot(*(high - low)))


def point(x: float, y: float) -> str:
    """A place in words, px."""
    return f"({x:z.1f}, {y:z.1f})"


def percent(share: float) -> str:
    """A share in words."""
    return f"{100 * share:.0f} %"
