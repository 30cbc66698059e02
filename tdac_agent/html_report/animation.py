"""Episodes as few whole numbers: what the player in the page draws."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.html_report.scene import Scene
from tdac_agent.runs.history import Told, Tried
from tdac_agent.tasks.task import Task
from tdac_agent.verification.diagnosis.figures import contact_of
from tdac_agent.verification.diagnosis.report import Episode

Rows = NDArray[np.float64]

FINENESS = 4.0
"""Whole numbers in a px of the picture."""
TURNS = 100.0
"""Whole numbers in a rad."""
TOLERANCE = 0.5
"""How far from where it was the body may be drawn at any time, px."""
RAD = 20.0
"""px that an error of one rad of the heading counts as."""
MOST_POINTS = 400
ALL_POINTS = 60_000
"""In all episodes of a run."""


def animations(told: Told, task: Task, scene: Scene) -> list[dict[str, Any]]:
    """The episodes of a run, of those candidates that have any.

    Returns:
        A dict per episode for the player: candidate, name, outcome, dt, steps, points
        (differences of step, x, y and heading, one after the other) and contact.
    """
    found = [(one, *pair) for one in told.tried for pair in _episodes(one)]
    most = max(20, min(MOST_POINTS, ALL_POINTS // max(1, len(found))))
    return [_told(task, scene, most, *each) for each in found]


def _episodes(one: Tried) -> Iterator[tuple[Episode, Trajectory]]:
    """Episodes whose trajectory is there."""
    if one.report is None:
        return
    kept = dict(one.trajectories())
    for episode in one.report.episodes:
        trajectory = kept.get(episode.name)
        # A file may hold another run of that start, one driven by `run_episode`.
        if trajectory is not None and trajectory.steps == episode.steps > 0:
            yield episode, trajectory


def _told(
    task: Task,
    scene: Scene,
    most: int,
    one: Tried,
    episode: Episode,
    trajectory: Trajectory,
) -> dict[str, Any]:
    poses = scene.at(trajectory.poses)
    kept = thinned(poses, most)
    rows = np.column_stack([kept, poses[kept] * (FINENESS, FINENESS, TURNS)])
    whole = np.rint(rows).astype(int)
    touched = contact_of(task.nominal, trajectory, episode.outcome)
    contact = None if touched is None else scene.at(np.array([touched]))[0].round(1)
    return {
        "candidate": f"{one.k}.{one.j}",
        "name": episode.name,
        "outcome": episode.outcome,
        "dt": trajectory.dt,
        "steps": trajectory.steps,
        "points": np.diff(whole, axis=0, prepend=0).ravel().tolist(),
        "contact": None if contact is None else contact.tolist(),
    }


def thinned(poses: Rows, most: int, tolerance: float = TOLERANCE) -> NDArray[np.intp]:
    """Steps between which poses are nearly linear in time.

    Splits where the line is farthest off, the worst part first (after Ramer, Douglas
    and Peucker, with time for the way).

    Args:
        poses: Shape (n, 3): px, px, rad, headings without jumps.
        most: Steps to keep at most, 2 or more.
        tolerance: Greatest distance of a pose from the line, px; a rad is `RAD` px.
            It may be more where that needs more steps than `most`.

    Returns:
        Their indices in order, the first and the last included.
    """
    scaled = poses * (1.0, 1.0, RAD)
    kept = {0, len(poses) - 1}
    parts = [_worst(scaled, 0, len(poses) - 1)]
    while parts and len(kept) < most and -parts[0][0] > tolerance:
        _, middle, first, last = heapq.heappop(parts)
        kept.add(middle)
        heapq.heappush(parts, _worst(scaled, first, middle))
        heapq.heappush(parts, _worst(scaled, middle, last))
    return np.array(sorted(kept))


def _worst(rows: Rows, first: int, last: int) -> tuple[float, int, int, int]:
    """The pose farthest off the line of a part: (minus its distance, it, the part)."""
    share = np.linspace(0.0, 1.0, last - first + 1)[:, None]
    line = rows[first] + share * (rows[last] - rows[first])
    off = np.abs(rows[first : last + 1] - line).max(axis=1)
    farthest = int(off.argmax())
    return -float(off[farthest]), first + farthest, first, last
