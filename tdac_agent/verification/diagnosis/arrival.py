"""Why a robot that touched nothing did not reach its goal: cause, step and figures."""

from __future__ import annotations

import math

import numpy as np

from tdac_agent.episodes.trajectory import Rollout, Trajectory
from tdac_agent.tasks.parts import Surroundings
from tdac_agent.tasks.units import Units
from tdac_agent.verification.diagnosis.motion import (
    flips,
    forward,
    lengths,
    rounds_about,
    turns,
    wheels_turn,
)
from tdac_agent.verification.diagnosis.stall import (
    FLIPS,
    PROGRESS,
    Finding,
    percent,
    standing_since,
    why_stalled,
)

# Share of the episode without progress from which a robot is stalled, not too slow.
_STALLED = 0.2


def why_no_arrival(rollout: Rollout, around: Surroundings) -> Finding:
    """Finds why a robot that touched nothing did not reach its goal."""
    trajectory, units = rollout.trajectory, around.units
    gone = np.hypot(*(trajectory.poses[:, :2] - trajectory.poses[0, :2]).T).max()
    if gone < PROGRESS and np.abs(turns(trajectory)).sum() < 1.0:
        text = f"in {trajectory.steps} steps it moved at most {units.far(gone)}"
        return Finding("no motion", f"{text} from its start and hardly turned.", 0)
    since = last_progress(rollout)
    if rollout.reached or trajectory.steps - since < _STALLED * trajectory.steps:
        return _unfinished(trajectory, around)
    return (
        _missed_goal(rollout, since, units)
        or _wrong_goal(rollout, around)
        or why_stalled(trajectory, since, rollout.radius, units)
    )


def near_goal(rollout: Rollout) -> float:
    """Remaining path below which a robot counts as having come near its goal."""
    d0 = float(rollout.trajectory.path_distances[0])
    near = 3.0 * max(rollout.tolerance, rollout.radius)
    return min(near, max(0.25 * d0, 1.5 * rollout.tolerance))


def last_progress(rollout: Rollout) -> int:
    """Step after which a robot hardly came nearer to its goal."""
    distances = rollout.trajectory.path_distances
    progress = float(distances[0] - distances.min())
    # Creeping and jittering are no progress.
    slack = max(PROGRESS, min(0.05 * progress, 0.5 * rollout.radius))
    return int(np.argmax(distances <= float(distances.min()) + slack))


def _unfinished(trajectory: Trajectory, around: Surroundings) -> Finding:
    """The robot was still making progress when its time was over."""
    distances, steps = trajectory.path_distances, trajectory.steps
    limit, far = around.full_speed, around.units.far
    driven, seconds = float(lengths(trajectory).sum()), steps * trajectory.dt
    speed = float(np.abs(forward(trajectory)).mean())
    facts = (
        f"covered {percent(1 - distances[-1] / max(distances[0], 1e-9))} of the path "
        f"in {steps} steps, at a mean speed of {far(limit * speed)}/s "
        f"({percent(speed)} of the wheel limit); at least "
        f"{far(distances[0] / seconds)}/s was needed; it drove {far(driven, 0)} "
        f"for {far(distances[0] - distances[-1], 0)} of progress; both "
        f"wheels stood still in {percent(1 - wheels_turn(trajectory).mean())} of the "
        f"steps."
    )
    reversed_share = flips(trajectory, 0)
    spin = float(np.abs(np.diff(trajectory.actions, axis=1)).mean()) / 2.0
    if reversed_share >= 5 * FLIPS and spin >= 0.3:
        text = "it reversed its turning or driving direction in "
        text += f"{percent(reversed_share)} of the steps and {facts}"
        return Finding("oscillating", text, steps)
    return Finding("too slow", f"it {facts}", steps)


def _missed_goal(rollout: Rollout, since: int, units: Units) -> Finding | None:
    """The robot came near its goal but did not reach it."""
    trajectory, straight = rollout.trajectory, rollout.distances("euclidean")
    distances = trajectory.path_distances
    within = straight <= rollout.tolerance
    if within.any():
        step = int(np.argmax(within))
        text = (
            f"in step {step} it was {units.far(straight[step])} from the goal, within "
            f"the tolerance of {units.far(rollout.tolerance)}, but a wall is in "
            f"between: the path to it is {units.far(distances[step])} long."
        )
        return Finding("missed goal", text, step)
    if distances[since] > near_goal(rollout):
        return None
    best = int(np.argmin(distances))
    after = _after_the_goal(rollout, since, best, units)
    if after is None:
        return None
    step, what = after
    text = (
        f"in step {best} it was {units.far(straight[best])} from the goal (tolerance "
        f"{units.far(rollout.tolerance)}); {what}."
    )
    return Finding("missed goal", text, step)


def _after_the_goal(
    rollout: Rollout, since: int, best: int, units: Units
) -> tuple[int, str] | None:
    """What a robot did after it was nearest to its goal, if that is clear.

    Returns:
        The step to look at, and the text.
    """
    trajectory, straight = rollout.trajectory, rollout.distances("euclidean")[since:]
    rounds = rounds_about(trajectory, since, rollout.goal)
    away = float(trajectory.path_distances[-1] - trajectory.path_distances[best])
    if abs(rounds) >= 2.0 and straight.max() < 4.0 * near_goal(rollout):
        sense = "clockwise" if rounds > 0 else "counter-clockwise"
        return best, (
            f"after step {since} it circled the goal {abs(rounds):.1f} times, {sense} "
            f"seen from above, {units.amount(straight.min())} to "
            f"{units.far(straight.max())} "
            f"from it"
        )
    rest = standing_since(trajectory)
    if straight[-1] <= near_goal(rollout) and rest < trajectory.steps:
        place = units.point(*trajectory.poses[-1, :2])
        text = f"it stood still from step {rest} to the end at {place}, "
        return rest, f"{text}{units.far(straight[-1])} from the goal"
    if away > 2.0 * rollout.radius:
        text = "it then passed by and moved away: its remaining path grew by"
        return best, f"{text} {units.far(away)}"
    return None


def _wrong_goal(rollout: Rollout, around: Surroundings) -> Finding | None:
    """The robot ended where the goal would be if its coordinates were mixed up."""
    trajectory, units = rollout.trajectory, around.units
    final = trajectory.poses[-math.ceil(_STALLED * trajectory.steps) :, :2]
    start = trajectory.poses[0, :2]
    for mistake, place in around.mistaken_goals().items():
        off = float(np.hypot(*(final - place).T).max())
        apart = min(math.dist(place, rollout.goal), math.dist(place, start))
        if off <= rollout.tolerance + rollout.radius < apart:
            text = (
                f"it ended within {units.far(off)} of {units.point(*place)}, "
                f"which is the goal {units.point(*rollout.goal)} with {mistake}."
            )
            return Finding("wrong goal", text, trajectory.steps)
    return None
