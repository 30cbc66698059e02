"""The map or world of a task as diagnoses see it, in units of the screen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tdac_agent.episodes.trajectory import Rollout, Trajectory
from tdac_agent.tasks.parts import Surroundings
from tdac_agent.tasks.registry import environment
from tdac_agent.tasks.setting import Nominal
from tdac_agent.tasks.units import Units


def surroundings_of(task: Nominal, shown: Units | None = None) -> Surroundings:
    """The surroundings of a task; `shown` are the units of texts, if others."""
    around = environment(task.env_id).surroundings(task)
    return around if shown is None else around.shown_in(shown)


def trajectory_on_screen(trajectory: Trajectory, units: Units) -> Trajectory:
    """Converts a trajectory to units of the screen."""
    movers = trajectory.movers
    if movers is not None:
        places = units.on_screen(movers[..., :2].reshape(-1, 2))
        movers = np.dstack(
            [places.reshape(*movers.shape[:2], 2), movers[..., 2] * units.scale]
        ).astype(np.float32)
    return replace(
        trajectory,
        movers=movers,
        poses=units.on_screen(trajectory.poses),
        path_distances=trajectory.path_distances * units.scale,
    )


def rollout_on_screen(rollout: Rollout, units: Units) -> Rollout:
    """Converts an episode to units of the screen."""
    (goal,) = units.on_screen([rollout.goal])
    return replace(
        rollout,
        trajectory=trajectory_on_screen(rollout.trajectory, units),
        goal=(float(goal[0]), float(goal[1])),
        radius=rollout.radius * units.scale,
        tolerance=rollout.tolerance * units.scale,
    )
