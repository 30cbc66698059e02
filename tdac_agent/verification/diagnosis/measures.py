"""Measures of an episode: time, path length, clearance, smoothness."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from tdac_agent.episodes.trajectory import Outcome, Rollout
from tdac_agent.storage.printable_record import StrictRecord
from tdac_agent.tasks.setting import Nominal
from tdac_envs.grid.plan import path_length

# Cut-off frequency (Hz), threshold and zero padding of the spectral arc length.
_HIGHEST, _FAINT, _PADDING = 10.0, 0.05, 4
_DIGITS = 6


class Measured(StrictRecord):
    """Measures of one episode of an evaluation; lengths in px, for the e-puck in m.

    Measures of path and smoothness are None unless the episode succeeded.
    """

    seed: int
    outcome: Outcome
    steps: int
    collisions: int
    seconds: float = Field(description="Simulated time.")
    driven: float = Field(description="Length of the driven path.")
    shortest: float | None = Field(
        None, description="Length of the shortest path, straightened."
    )
    path_ratio: float | None = Field(
        None, description="Driven plus remaining path, relative to the shortest path."
    )
    time_ratio: float | None = Field(
        None, description="Time relative to the shortest path at full speed."
    )
    smoothness: float | None = Field(
        None, description="Spectral arc length of the speed; 0 would be smoothest."
    )
    clearance_min: float = Field(description="Least gap between body and obstacles.")
    clearance_mean: float = Field(description="Mean gap between body and obstacles.")
    error: str | None = None

    @property
    def success(self) -> bool:
        """Whether the goal was reached without contact."""
        return self.outcome == "reached" and not self.collisions


def measure(rollout: Rollout, seed: int, task: Nominal) -> Measured:
    """Measures an episode.

    Args:
        rollout: The episode.
        seed: Seed of its environment.
        task: Task with the start and the goal of the episode.
    """
    trajectory = rollout.trajectory
    steps = np.hypot(*np.diff(trajectory.poses[:, :2], axis=0).T)
    gaps = np.maximum(rollout.rooms - rollout.radius, 0.0)
    seconds, driven = trajectory.steps * trajectory.dt, float(steps.sum())
    of_success: dict[str, float] = {}
    if rollout.reached and not rollout.collisions:
        shortest = shortest_path_length(task)
        rest = float(trajectory.path_distances[-1])
        of_success = {
            "shortest": shortest,
            "path_ratio": (driven + rest) / shortest,
            "time_ratio": seconds * task.full_step / (shortest * task.dt),
            "smoothness": spectral_arc_length(steps / trajectory.dt, trajectory.dt),
        }
    figures = {
        "seconds": seconds,
        "driven": driven,
        "clearance_min": float(gaps.min()),
        "clearance_mean": float(gaps.mean()),
        **of_success,
    }
    return Measured(
        seed=seed,
        outcome=rollout.outcome,
        steps=trajectory.steps,
        collisions=rollout.collisions,
        error=rollout.error,
        **{name: round(value, _DIGITS) for name, value in figures.items()},
    )


def shortest_path_length(task: Nominal) -> float:
    """Length of the shortest path from a task's start to its goal, px or m.

    The shortest 8-connected grid path, after every shortcut that the body can take; see
    `Nominal.shortest_path`.
    """
    path = task.shortest_path(task.start)
    return task.shortest if len(path) < 2 else path_length(path)


def least_steps(task: Nominal) -> float:
    """OT of a task: its shortest path at full speed, up to the goal's tolerance.

    No drive needs fewer steps; see `tdac_envs.ladder.scores`.
    """
    length = shortest_path_length(task) - task.goal_tolerance
    return max(1.0, length / task.full_step)


def spectral_arc_length(speeds: NDArray[np.float64], dt: float) -> float:
    """Smoothness of a movement (SPARC): minus the arc length of its speed's spectrum.

    S. Balasubramanian, A. Melendez-Calderon, A. Roby-Brami, E. Burdet, "On the analysis
    of movement smoothness", J. NeuroEng. Rehabil. 12:112, 2015, with the constants of
    that paper: 10 Hz, threshold 0.05, zero padding level 4. It does not depend on the
    size or the duration of a movement. It is about -1.4 for a single stroke, and lower
    the more often the robot slows down and speeds up again.

    Args:
        speeds: Speeds at equal intervals, not negative, shape (T,).
        dt: Interval, s.
    """
    if not speeds.size or speeds.max() == 0.0:
        return 0.0
    size = 2 ** (math.ceil(math.log2(speeds.size)) + _PADDING)
    spectrum = np.abs(np.fft.rfft(speeds, size))
    spectrum /= spectrum.max()
    frequencies = np.fft.rfftfreq(size, dt)
    kept = frequencies <= _HIGHEST
    spectrum, frequencies = spectrum[kept], frequencies[kept]
    strong = np.flatnonzero(spectrum >= _FAINT)
    part = slice(strong[0], strong[-1] + 1)
    spectrum, frequencies = spectrum[part], frequencies[part]
    if len(spectrum) < 2:
        return 0.0
    along = np.diff(frequencies) / (frequencies[-1] - frequencies[0])
    return -float(np.hypot(along, np.diff(spectrum)).sum())
