"""Diagnoses a judged episode from its trajectory alone."""

from __future__ import annotations

import math
import re
from typing import Any

from tdac_agent.episodes.trajectory import Rollout, Trajectory
from tdac_agent.storage.plain import plain
from tdac_agent.tasks.parts import Surroundings
from tdac_agent.tasks.setting import Nominal
from tdac_agent.tasks.units import Units
from tdac_agent.verification.diagnosis.arrival import near_goal, why_no_arrival
from tdac_agent.verification.diagnosis.course import (
    goal_bearing,
    heading_error,
    turned_away,
)
from tdac_agent.verification.diagnosis.gap import too_close_text
from tdac_agent.verification.diagnosis.motion import forward, saturated
from tdac_agent.verification.diagnosis.mover import (
    MoverTouch,
    how_it_drove,
    nearest_mover,
    time_in_sight,
    where_from,
)
from tdac_agent.verification.diagnosis.nearest import gap_of
from tdac_agent.verification.diagnosis.report import Cause, Diagnosis
from tdac_agent.verification.diagnosis.stall import PROGRESS, percent
from tdac_agent.verification.diagnosis.surroundings import (
    rollout_on_screen,
    surroundings_of,
)
from tdac_agent.verification.diagnosis.touch import side_of, where_on_the_wall
from tdac_envs.drive.task import Pose

LAST_POSES = 4
# Least share and number of turns away from the path that are reported.
_AWAY, _AWAY_STEPS = 0.8, 8
_RETURNED = "run_episode returned"
_OUT_OF_CPU = re.compile(r"CPU time")
_CONTRACT = re.compile(
    rf"must return|reset\(\)|step\(\)|{_RETURNED}|module 'controller'"
)


def diagnose(rollout: Rollout, task: Nominal, shown: Units | None = None) -> Diagnosis:
    """Finds the cause and circumstances of a failed (or late) episode.

    For a held-out episode the cause is `held out`, and there are no figures.

    Args:
        rollout: The episode.
        task: Its task.
        shown: Units of the text, as from `Setting.shown`; by default those of the
            environment, which controllers and models use. Figures are always in these.
    """
    if rollout.outcome == "not run":
        return Diagnosis(cause="error", text=f"{rollout.name}: {rollout.error}.")
    if rollout.held_out:
        text = "A held-out start failed; its details are not disclosed."
        return Diagnosis(cause="held out", text=text)
    around = surroundings_of(task, shown)
    near = _passed_too_close(rollout, task, around.units)
    return _diagnose(rollout_on_screen(rollout, around.units), around, near)


def _passed_too_close(rollout: Rollout, task: Nominal, units: Units) -> str:
    """Where the body came too close to an obstacle; empty if it did not."""
    gap = gap_of(rollout, task)
    if gap is None or not gap.too_close:
        return ""
    return f"It came {too_close_text(gap, units)}. "


def _diagnose(rollout: Rollout, around: Surroundings, near: str) -> Diagnosis:
    if rollout.error is not None:
        return _error(rollout, around.units)
    if rollout.trajectory.steps == 0:
        text = "no motion: no step was taken."
        return _diagnosis(rollout, around.units, "no motion", text, 0)
    if rollout.outcome == "collision":
        return _collision(rollout, around)
    return _no_arrival(rollout, around, near)


def _error(rollout: Rollout, units: Units) -> Diagnosis:
    message, steps = f"{plain(rollout.error or '')}.", rollout.trajectory.steps
    cause: Cause = "error"
    if rollout.timed_out or _OUT_OF_CPU.search(message):
        cause = "time-out"
    elif _CONTRACT.search(message):
        cause = "contract"
    when = f"after {steps} steps" if steps else "before its first step"
    # If `run_episode` returned, its message already contains the number of steps.
    failed = "" if _RETURNED in message else f"the controller failed {when}: "
    text = f"{cause}: {failed}{message}"
    return _diagnosis(rollout, units, cause, text, steps)


def _collision(rollout: Rollout, around: Surroundings) -> Diagnosis:
    trajectory, units = rollout.trajectory, around.units
    pose, speed = _pose(trajectory, trajectory.steps), float(forward(trajectory)[-1])
    share = saturated(trajectory)
    touched, facts = _touched(rollout, around)
    error, course = _course(rollout, around)
    limited = f"A wheel was at its limit in {percent(share)} of the steps. "
    text = (
        f"collision in step {trajectory.steps} "
        f"({trajectory.steps * trajectory.dt:.1f} s) at {units.point(pose.x, pose.y)}, "
        f"heading {units.degrees(pose.heading)}°, speed "
        f"{units.far(speed * around.full_speed, 0)}/s: {touched} "
        f"{limited if share else ''}{_passed_goal(rollout, units)}{course}"
    )
    return _diagnosis(
        rollout,
        units,
        "collision",
        text,
        trajectory.steps,
        heading_error=error,
        saturated=round(share, 3),
        **facts,
    )


def _touched(rollout: Rollout, around: Surroundings) -> tuple[str, dict[str, Any]]:
    """What the body touched, as text and as fields of the diagnosis."""
    mover = nearest_mover(rollout.trajectory, rollout.radius)
    if mover is not None and rollout.contact in ("mover", "mover_standing"):
        return _touched_mover(rollout, around, mover)
    return _touched_wall(rollout, around)


def _touched_mover(
    rollout: Rollout, around: Surroundings, mover: MoverTouch
) -> tuple[str, dict[str, Any]]:
    trajectory, units = rollout.trajectory, around.units
    side, thing = side_of(mover.bearing), f"mover {mover.number}"
    drove = how_it_drove(trajectory, stood=rollout.contact == "mover_standing")
    text = (
        f"the {side} of the body touched {thing}, which came from "
        f"{where_from(trajectory, mover.number)} and "
        f"{time_in_sight(around, trajectory, mover.number)}; the robot {drove}."
    )
    place = units.kept_place(*mover.place)
    return text, {"side": side, "wall": place, "thing": thing}


def _touched_wall(rollout: Rollout, around: Surroundings) -> tuple[str, dict[str, Any]]:
    trajectory, units = rollout.trajectory, around.units
    pose, speed = _pose(trajectory, trajectory.steps), float(forward(trajectory)[-1])
    touch = around.touch(pose, rollout.radius + 3.0)
    assert touch is not None
    side = side_of(touch.bearing)
    towards = pose.heading + (math.pi if speed < 0.0 else 0.0)
    corner = where_on_the_wall(touch, towards, units)
    text = (
        f"the {side} of the body touched the {touch.thing} at "
        f"{units.point(*touch.wall)}{', ' if corner else ''}{corner}. "
        f"{around.seen(touch, trajectory)}"
    )
    return text, {
        "side": side,
        "wall": units.kept_place(*touch.wall),
        "corner": None if touch.corner is None else units.kept_place(*touch.corner),
        "thing": touch.thing,
    }


def _passed_goal(rollout: Rollout, units: Units) -> str:
    distances = rollout.trajectory.path_distances
    best = int(distances.argmin())
    stayed = distances[-1] - distances[best] < PROGRESS
    if stayed or distances[best] > near_goal(rollout):
        return ""
    left = f"{units.far(distances[best])} of path left"
    return f"It had passed the goal in step {best} with {left}. "


def _no_arrival(rollout: Rollout, around: Surroundings, near: str) -> Diagnosis:
    cause, text, step = why_no_arrival(rollout, around)
    trajectory = rollout.trajectory
    end = _pose(trajectory, trajectory.steps)
    touch = around.touch(end, 5.0 * rollout.radius)
    if touch is not None and cause in ("stuck", "oscillating", "no motion"):
        thing = "wall" if touch.border else touch.thing
        text += (
            f" The nearest {thing} is {around.units.far(touch.gap)} from the body, at "
            f"its {side_of(touch.bearing)}."
        )
    error, course = _course(rollout, around)
    text = f"{cause}: {text} {near}{course}"
    return _diagnosis(rollout, around.units, cause, text, step, heading_error=error)


def _course(rollout: Rollout, around: Surroundings) -> tuple[float | None, str]:
    """Heading error at the end, and text on it and on turns away from the path."""
    trajectory = rollout.trajectory
    error = heading_error(around, trajectory, trajectory.steps)
    if error is None:
        return None, ""
    straight = goal_bearing(trajectory, rollout.goal)
    text = (
        f"Heading error: the shortest path is {_turn(error)}, the goal itself "
        f"{_turn(straight)}. "
    )
    share, steps = turned_away(around, trajectory, rollout.goal)
    if steps >= _AWAY_STEPS and share >= _AWAY:
        text += (
            f"In {percent(share)} of its first {steps} turning steps it turned away "
            "from both: check the sign of the turn. "
        )
    return round(error, 3), text


def _turn(angle: float) -> str:
    """An angle in words: `41° to the right`."""
    side = "right" if angle > 0 else "left"
    return f"{abs(math.degrees(angle)):.0f}° to the {side}"


def _diagnosis(
    rollout: Rollout, units: Units, cause: Cause, text: str, step: int, **facts: Any
) -> Diagnosis:
    """Builds a diagnosis, with the distances and the last poses added."""
    trajectory = rollout.trajectory
    text = f"{rollout.name}: {text.strip()}"
    if not len(trajectory.poses):
        return Diagnosis(cause=cause, text=text, step=step, episode=rollout.name)
    distances = trajectory.path_distances
    d0, d_min = float(distances[0]), float(distances.min())
    x, y = units.kept_place(*trajectory.poses[step, :2].tolist())
    if trajectory.steps:
        text += (
            f" Path left: {units.far(d0)} at the start, {units.far(d_min)} at best. "
        )
        text += _last_poses(trajectory, units)
    return Diagnosis(
        cause=cause,
        text=text,
        episode=rollout.name,
        step=step,
        x=x,
        y=y,
        d0=units.kept(d0),
        d_min=units.kept(d_min),
        **facts,
    )


def _last_poses(trajectory: Trajectory, units: Units) -> str:
    """The last poses with the wheel speeds applied there; equal rows are merged."""
    poses, actions = trajectory.poses.tolist(), trajectory.actions.tolist()
    end = units.pose(*poses[-1])
    groups = [(trajectory.steps, trajectory.steps, end)]
    for step in range(trajectory.steps - 1, -1, -1):
        place, (left, right) = units.pose(*poses[step]), actions[step]
        row = f"{place} [{left:z.2f} {right:z.2f}]"
        _, last, previous = groups[-1]
        # The pose at the end has no wheel speeds of its own.
        if previous == row or previous == place == end:
            groups[-1] = (step, last, row)
        elif len(groups) < LAST_POSES:
            groups.append((step, step, row))
        else:
            break
    rows = [
        f"{first}{f'-{last}' if last > first else ''}: {row}"
        for first, last, row in reversed(groups)
    ]
    what = f"x y in {units.printed_place}, heading in ° [left right]"
    return f"Last poses (step: {what}): {'; '.join(rows)}."


def _pose(trajectory: Trajectory, step: int) -> Pose:
    return Pose(*trajectory.poses[step].tolist())
