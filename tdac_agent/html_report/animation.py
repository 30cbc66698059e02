"""Episodes as short lists of integers, for the player in the page."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.html_report.names import candidate_name
from tdac_agent.html_report.scene import TaskPicture
from tdac_agent.runs.history import CandidateHistory, RunHistory
from tdac_agent.tasks.setting import Nominal
from tdac_agent.tasks.task import Task
from tdac_agent.verification.diagnosis.figures import contact_of
from tdac_agent.verification.diagnosis.report import Episode

Rows = NDArray[np.float64]

FINENESS = 4.0
"""Integer units per px of the picture."""
TURNS = 100.0
"""Integer units per rad."""
TOLERANCE = 0.5
"""Largest distance between the drawn and the true pose at any time, px."""
RAD = 20.0
"""Distance that a heading error of one rad counts as, px."""
MOST_POINTS = 400
NOMINAL = "nominal"
"""Name of the episode from the start of the task."""
ALL_POINTS = 60_000
"""Maximum number of points of all episodes of a run together."""
ALL_MOVER_POINTS = 60_000
"""The same of their movers; each has at least 20."""


def animations(
    history: RunHistory, task: Task, scene: TaskPicture, *, brief: bool = False
) -> list[dict[str, Any]]:
    """Encodes the recorded episodes of all candidates of a run.

    Args:
        history: The run.
        task: Its task.
        scene: The picture on which they are shown.
        brief: Whether to leave out drives from other starts that reach the goal.

    Returns:
        A dict per episode for the player: candidate, its label, name, and what
        `encoded` returns.
    """
    entries = [
        (one, *pair)
        for one in history.tried
        for pair in recorded_episodes(one)
        if not brief or pair[0].outcome != "reached" or pair[0].name == NOMINAL
    ]
    most = shares([each[-1] for each in entries])
    return [
        {
            "candidate": f"{one.k}.{one.j}",
            "label": candidate_name(one.k, one.j),
            "name": episode.name,
            **encoded(task.nominal, scene, trajectory, episode.outcome, most),
        }
        for one, episode, trajectory in entries
    ]


def shares(entries: Sequence[Trajectory]) -> tuple[int, int]:
    """Most points of each episode, and of each mover, for a page with all of them."""
    return (
        _share(ALL_POINTS, len(entries)),
        _share(ALL_MOVER_POINTS, sum(map(_count, entries))),
    )


def encoded(
    nominal: Nominal,
    scene: TaskPicture,
    trajectory: Trajectory,
    outcome: str,
    most: tuple[int, int],
) -> dict[str, Any]:
    """Encodes an episode.

    Args:
        nominal: Its task.
        scene: The picture on which it is shown.
        trajectory: The episode.
        outcome: How it ended.
        most: From `shares`.

    Returns:
        Outcome, dt, steps, points (differences of step, x, y and heading, flattened),
        contact, and movers: radius and points (differences of step, x and y) of each.
    """
    poses = scene.at(trajectory.poses)
    kept = thinned(poses, most[0])
    rows = np.column_stack([kept, poses[kept] * (FINENESS, FINENESS, TURNS)])
    whole = np.rint(rows).astype(int)
    touched = contact_of(nominal, trajectory, outcome)
    contact = None if touched is None else scene.at(np.array([touched]))[0].round(1)
    return {
        "outcome": outcome,
        "dt": trajectory.dt,
        "steps": trajectory.steps,
        "points": np.diff(whole, axis=0, prepend=0).ravel().tolist(),
        "contact": None if contact is None else contact.tolist(),
        "movers": _movers(scene, most[1], trajectory),
    }


def _share(points: int, count: int) -> int:
    """Maximum number of points of each of `count` ways."""
    return max(20, min(MOST_POINTS, points // max(1, count)))


def _count(trajectory: Trajectory) -> int:
    """Number of movers."""
    return 0 if trajectory.movers is None else trajectory.movers.shape[1]


def _movers(
    scene: TaskPicture, most: int, trajectory: Trajectory
) -> list[dict[str, Any]]:
    """Encodes the movers of an episode; px of the picture, times `FINENESS`."""
    if trajectory.movers is None:
        return []
    encoded = []
    for disc in range(_count(trajectory)):
        places = scene.at(trajectory.movers[:, disc, :2].astype(np.float64))
        flat = np.column_stack([places, np.zeros(len(places))])
        kept = thinned(flat, most)
        rows = np.column_stack([kept, np.rint(places[kept] * FINENESS)]).astype(int)
        radius = float(trajectory.movers[0, disc, 2]) * scene.chart.scale * scene.zoom
        points = np.diff(rows, axis=0, prepend=0).ravel().tolist()
        encoded.append({"radius": round(radius, 1), "points": points})
    return encoded


def recorded_episodes(one: CandidateHistory) -> Iterator[tuple[Episode, Trajectory]]:
    """The episodes of a candidate that have a stored trajectory."""
    if one.report is None:
        return
    kept = dict(one.trajectories())
    for episode in one.report.episodes:
        trajectory = kept.get(episode.name)
        # The file may hold an episode of `run_episode` from the same start.
        if trajectory is not None and trajectory.steps == episode.steps > 0:
            yield episode, trajectory


def thinned(poses: Rows, most: int, tolerance: float = TOLERANCE) -> NDArray[np.intp]:
    """Selects steps so that the poses between them are nearly linear in time.

    Splits the worst segment first, at its largest deviation (Ramer-Douglas-Peucker,
    with deviations taken at equal times).

    Args:
        poses: Shape (n, 3): x and y, px, and unwrapped heading, rad.
        most: Maximum number of steps to keep, at least 2.
        tolerance: Largest deviation of a pose from its segment, px; a rad counts as
            `RAD` px. Exceeded if it would need more than `most` steps.

    Returns:
        Indices of the kept steps in order, including the first and the last.
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
    """Heap entry of a segment: (minus largest deviation, its step, first, last)."""
    share = np.linspace(0.0, 1.0, last - first + 1)[:, None]
    line = rows[first] + share * (rows[last] - rows[first])
    off = np.abs(rows[first : last + 1] - line).max(axis=1)
    farthest = int(off.argmax())
    return -float(off[farthest]), first + farthest, first, last
