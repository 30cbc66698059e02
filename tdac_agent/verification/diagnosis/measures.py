"""Measures of tasks and drives: shortest path, least time, smoothness."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tdac_agent.tasks.setting import Nominal
from tdac_envs.grid.plan import path_length

# Cut-off frequency (Hz), threshold and zero padding of the spectral arc length.
_HIGHEST, _FAINT, _PADDING = 10.0, 0.05, 4


def shortest_path_length(task: Nominal) -> float:
    """Length of the shortest path from a task's start to its goal, px or m.

    The shortest 8-connected grid path, after every shortcut that the body can take; see
    `Nominal.shortest_path`.
    """
    path = task.shortest_path(task.start)
    return task.shortest if len(path) < 2 else path_length(path)


def least_steps(task: Nominal, length: float | None = None) -> float:
    """OT of a task: its shortest path at full speed, up to the goal's tolerance.

    No drive needs fewer steps; see `tdac_envs.drive.scores`.

    Args:
        task: The task.
        length: Length of its shortest path, if it is known.
    """
    whole = shortest_path_length(task) if length is None else length
    return max(1.0, (whole - task.goal_tolerance) / task.full_step)


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
