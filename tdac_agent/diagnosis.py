"""What happened in a judged episode, from its trajectory alone."""

from __future__ import annotations

import math
import re

import numpy as np
from numpy.typing import NDArray

from tdac_agent.reference import pull
from tdac_agent.report import Cause, Diagnosis
from tdac_agent.trajectory import Rollout, Trajectory
from tdac_envs.task2d import Map2DTask, Pose

LAST_POSES = 6
_PATH_AHEAD = 400
# A wheel this near its limit counts as saturated.
_SATURATED = 0.999
# A step nearer than this, px, is no progress: it is what a turn in place drifts.
_PROGRESS = 1.0
# Share of the episode without progress from which a robot is not merely slow.
_STALLED = 0.2
# Share of steps that reverse a turn or a drive: a period of 40 steps (2 s) or less.
_FLIPS = 0.05
_SIDES = (
    "front",
    "front right",
    "right",
    "rear right",
    "rear",
    "rear left",
    "left",
    "front left",
)
_OUT_OF_CPU = re.compile(r"CPU time")
_CONTRACT = re.compile(r"must return|reset\(\)|step\(\)|run_episode|has no ")


def diagnose(rollout: Rollout, task: Map2DTask) -> Diagnosis:
    """Cause and circumstances of a failed (or late) episode.

    Args:
        rollout: The episode.
        task: Map and body of the episode.

    Returns:
        For an episode that is held out: the cause `held out`, and no figures.
    """
    if rollout.outcome == "not run":
        return Diagnosis(cause="error", text=f"{rollout.name}: {rollout.error}.")
    if rollout.held_out:
        text = "A start that is held out failed; nothing more is told of it."
        return Diagnosis(cause="held out", text=text)
    if rollout.error is not None:
        return _error(rollout)
    if rollout.trajectory.steps == 0:
        return Diagnosis(cause="no motion", text=f"{rollout.name}: no step was made.")
    if rollout.outcome == "collision":
        return _collision(rollout, task)
    return _no_arrival(rollout, task)


def _error(rollout: Rollout) -> Diagnosis:
    message = rollout.error or ""
    cause: Cause = "error"
    if rollout.timed_out or _OUT_OF_CPU.search(message):
        cause = "time-out"
    elif _CONTRACT.search(message):
        cause = "contract"
    steps = rollout.trajectory.steps
    text = f"{rollout.name}: the controller failed after {steps} steps: {message}"
    return _diagnosis(rollout, cause, text, steps)


def _collision(rollout: Rollout, task: Map2DTask) -> Diagnosis:
    trajectory = rollout.trajectory
    pose = Pose(*(float(value) for value in trajectory.poses[-1]))
    wall_x, wall_y = _nearest_wall(task, pose.x, pose.y, rollout.radius + 3.0)
    side = side_of(pose, wall_x, wall_y)
    saturated = float((np.abs(trajectory.actions) >= _SATURATED).any(axis=1).mean())
    text = (
        f"{rollout.name}: collision in step {trajectory.steps} at "
        f"({pose.x:.1f}, {pose.y:.1f}), heading {pose.heading:.2f} rad: the {side} of "
        f"the body touched the wall at ({wall_x:.1f}, {wall_y:.1f}), at "
        f"{_forward_speed(trajectory, task)[-1]:.0f} px/s. "
    )
    off = _heading_error(trajectory, task)
    if off is not None:
        turn = "right" if off > 0 else "left"
        text += f"The shortest path lay {abs(off):.2f} rad to the {turn}. "
    text += f"A wheel was at its limit in {100 * saturated:.0f} % of the steps. "
    return _diagnosis(rollout, "collision", text, trajectory.steps, side=side)


def _no_arrival(rollout: Rollout, task: Map2DTask) -> Diagnosis:
    """An episode that ran out of time, or that arrived but was late."""
    trajectory = rollout.trajectory
    distances = trajectory.path_distances
    left = distances <= float(distances.min()) + _PROGRESS
    best = int(np.argmax(left))
    gone = np.hypot(*(trajectory.poses[:, :2] - trajectory.poses[0, :2]).T)
    turned = np.abs(_turns(trajectory)).sum()
    stalled = trajectory.steps - best
    if gone.max() < _PROGRESS and turned < 1.0:
        text = (
            f"{rollout.name}: no motion: in {trajectory.steps} steps the robot never "
            f"went {_PROGRESS:g} px from its start. "
        )
        return _diagnosis(rollout, "no motion", text, 0)
    if rollout.reached or stalled < _STALLED * trajectory.steps:
        return _unfinished(rollout, task)
    near = max(3.0 * rollout.tolerance, 3.0 * rollout.radius)
    away = float(distances[-1] - distances[best])
    if distances[best] <= near and away > 2.0 * rollout.radius:
        text = (
            f"{rollout.name}: missed the goal: in step {best} it was "
            f"{distances[best]:.1f} px off (tolerance {rollout.tolerance:.1f} px); "
            f"then it passed by and went {away:.1f} px away. "
        )
        return _diagnosis(rollout, "missed goal", text, best)
    return _stalled(rollout, best)


def _stalled(rollout: Rollout, since: int) -> Diagnosis:
    """No progress since a step: spinning, oscillating or stuck."""
    trajectory = rollout.trajectory
    turns = _turns(trajectory)[since:]
    net, total = abs(float(turns.sum())), float(np.abs(turns).sum())
    x, y = trajectory.poses[since, :2]
    spread = np.hypot(*(trajectory.poses[since:, :2] - (x, y)).T)
    where = (
        f"no progress since step {since} at ({x:.1f}, {y:.1f}); it then stayed within "
        f"{spread.max():.1f} px of it"
    )
    if net >= 4.0 * math.pi and net >= 0.7 * total:
        way = "right" if turns.sum() > 0 else "left"
        rounds = net / (2.0 * math.pi)
        text = (
            f"{rollout.name}: spinning: {where} and turned {rounds:.1f} times {way}. "
        )
        return _diagnosis(rollout, "spinning", text, since)
    flips = _flips(trajectory, since)
    if flips >= _FLIPS and net < 0.3 * max(total, 1.0):
        text = (
            f"{rollout.name}: oscillating: {where} and reversed its turn or its drive "
            f"in {100 * flips:.0f} % of the steps. "
        )
        return _diagnosis(rollout, "oscillating", text, since)
    moving = "standing" if spread.max() < rollout.radius else "driving about"
    text = f"{rollout.name}: stuck, {moving}: {where}. "
    return _diagnosis(rollout, "stuck", text, since)


def _unfinished(rollout: Rollout, task: Map2DTask) -> Diagnosis:
    """Still under way at the end of its time."""
    trajectory = rollout.trajectory
    flips = _flips(trajectory, 0)
    swing = float(np.abs(np.diff(trajectory.actions, axis=1)).mean()) / 2.0
    distances = trajectory.path_distances
    done = 1.0 - float(distances[-1] / max(distances[0], 1e-9))
    speed = float(np.abs(_forward_speed(trajectory, task)).mean())
    share = speed / task.robot.max_wheel_speed
    facts = (
        f"{100 * done:.0f} % of the way in {trajectory.steps} steps, at "
        f"{speed:.1f} px/s on average ({100 * share:.0f} % of the wheel limit). "
    )
    if flips >= 5 * _FLIPS and swing >= 0.3:
        text = (
            f"{rollout.name}: oscillating: it reversed its turn or its drive in "
            f"{100 * flips:.0f} % of the steps and made {facts}"
        )
        return _diagnosis(rollout, "oscillating", text, trajectory.steps)
    text = f"{rollout.name}: too slow: {facts}"
    return _diagnosis(rollout, "too slow", text, trajectory.steps)


def _diagnosis(
    rollout: Rollout, cause: Cause, text: str, step: int, side: str | None = None
) -> Diagnosis:
    """Adds the distances and the last poses to what is known."""
    trajectory = rollout.trajectory
    if not len(trajectory.poses):
        return Diagnosis(cause=cause, text=text.strip(), step=step)
    d0 = float(trajectory.path_distances[0])
    d_min = float(trajectory.path_distances.min())
    x, y = (float(value) for value in trajectory.poses[step, :2])
    text = (
        f"{text.strip()} Path left: {d0:.1f} px at the start, {d_min:.1f} px at best."
    )
    return Diagnosis(
        cause=cause,
        text=f"{text} {_last_poses(trajectory)}",
        step=step,
        x=round(x, 2),
        y=round(y, 2),
        side=side,
        d0=round(d0, 2),
        d_min=round(d_min, 2),
    )


def _last_poses(trajectory: Trajectory) -> str:
    """The last poses with the wheel speeds that followed, oldest first."""
    first = max(trajectory.steps - LAST_POSES + 1, 0)
    rows = []
    for step in range(first, trajectory.steps + 1):
        x, y, heading = trajectory.poses[step]
        row = f"{step}: {x:.1f} {y:.1f} {heading:.2f}"
        if step < trajectory.steps:
            left, right = trajectory.actions[step]
            row += f" [{left:.2f} {right:.2f}]"
        rows.append(row)
    return f"Last poses (step: x y heading [left right]): {'; '.join(rows)}."


def side_of(pose: Pose, x: float, y: float) -> str:
    """Side of the robot, as a person sees it, on which a point lies."""
    bearing = math.atan2(y - pose.y, x - pose.x) - pose.heading
    # y points down, so a positive bearing is to the right.
    return _SIDES[round(bearing / (math.pi / 4.0)) % 8]


def _nearest_wall(
    task: Map2DTask, x: float, y: float, reach: float
) -> tuple[float, float]:
    """The point of the occupied squares that is nearest to (x, y), px."""
    padded = task.terrain.padded
    height, width = padded.shape
    x0, y0 = max(math.floor(x - reach) + 1, 0), max(math.floor(y - reach) + 1, 0)
    x1, y1 = min(math.ceil(x + reach) + 2, width), min(math.ceil(y + reach) + 2, height)
    rows, columns = np.nonzero(padded[y0:y1, x0:x1])
    if rows.size == 0:
        return x, y
    # The map begins at pixel (1, 1) of the padded one.
    near_x = np.clip(x, columns + x0 - 1.5, columns + x0 - 0.5)
    near_y = np.clip(y, rows + y0 - 1.5, rows + y0 - 0.5)
    nearest = int(np.argmin((near_x - x) ** 2 + (near_y - y) ** 2))
    return float(near_x[nearest]), float(near_y[nearest])


def _heading_error(trajectory: Trajectory, task: Map2DTask) -> float | None:
    """Direction of the shortest path seen from the last heading, rad, right positive.

    At the wall itself there may be no path for the body; an earlier pose has one.
    """
    for x, y, heading in trajectory.poses[:-20:-1]:
        path = task.path_from(Pose(float(x), float(y), float(heading)))
        if len(path) > 1:
            # A shortest path on a grid has many forms; a pulled one has a direction.
            _, (to_x, to_y), *_ = pull(task, path[:_PATH_AHEAD])
            bearing = math.atan2(to_y - y, to_x - x)
            return math.remainder(bearing - float(heading), 2.0 * math.pi)
    return None


def _forward_speed(trajectory: Trajectory, task: Map2DTask) -> NDArray[np.float64]:
    """Forward speed of each step, px/s."""
    fractions = trajectory.actions.mean(axis=1, dtype=np.float64)
    return np.asarray(fractions * task.robot.max_wheel_speed)


def _turns(trajectory: Trajectory) -> NDArray[np.float64]:
    """Change of heading in each step, rad, right positive."""
    return np.diff(np.unwrap(trajectory.poses[:, 2]))


def _flips(trajectory: Trajectory, since: int) -> float:
    """Largest share of steps in which the turn, or the drive, was reversed."""
    actions = trajectory.actions[since:]
    shares = [0.0]
    for signal in (actions[:, 0] - actions[:, 1], actions.sum(axis=1)):
        signs = np.sign(signal[np.abs(signal) > 0.02])
        if len(actions):
            shares.append(float((signs[1:] != signs[:-1]).sum()) / len(actions))
    return max(shares)
