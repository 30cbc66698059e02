"""One judged episode as a line of results, and the means of many."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean
from typing import Any

import numpy as np
from pydantic import AliasChoices, ConfigDict, Field

from tdac_agent.episodes.trajectory import Contact, Outcome, Rollout
from tdac_agent.storage.printable_record import StrictRecord
from tdac_agent.tasks.setting import Nominal
from tdac_agent.tasks.units import Units
from tdac_agent.verification.diagnosis.diagnosis import diagnose
from tdac_agent.verification.diagnosis.gap import Gap
from tdac_agent.verification.diagnosis.losses import Losses, losses_of
from tdac_agent.verification.diagnosis.measures import spectral_arc_length
from tdac_agent.verification.diagnosis.nearest import gap_of
from tdac_agent.verification.diagnosis.report import Cause
from tdac_envs.drive.scores import barn_score, path_score, time_score

_DIGITS = 6
_FAILURE = {"cause", "step", "x", "y", "side", "text"}


class EpisodeRow(StrictRecord):
    """Figures of an episode of a task or on a world; lengths in px or m.

    A task has an episode for each `seed`, a task set one for each world, by its
    `index`. What describes a world is None for a task. `cause` to `text` are the
    diagnosis of a failure; of hidden worlds, only the cause may be told.
    """

    model_config = ConfigDict(populate_by_name=True)

    seed: int | None = None
    index: int | None = None
    generator: str | None = Field(None, description="What made the world.")
    outcome: Outcome
    steps: int
    horizon: int | None = None
    collisions: int = 0
    time_score: float = Field(
        0.0, description="Success weighted by completion time, SCT."
    )
    path_score: float = Field(0.0, description="Success weighted by path length, SPL.")
    barn_score: float = Field(0.0, description="Score of BARN, at most 0.5.")
    lost: Losses | None = Field(
        None, description="Where 1 - time score was lost; None on older records."
    )
    seconds: float | None = Field(None, description="Simulated time.")
    driven: float | None = Field(None, description="Length of the driven path.")
    d0: float | None = Field(None, description="Remaining path at the start.")
    d_min: float | None = Field(None, description="Least remaining path.")
    length: float | None = Field(
        None,
        validation_alias=AliasChoices("length", "shortest"),
        description="Length of the shortest path, straightened.",
    )
    least_steps: float | None = Field(None, description="OT, the least possible steps.")
    path_ratio: float | None = Field(
        None, description="Driven plus remaining path, relative to the shortest path."
    )
    time_ratio: float | None = Field(
        None, description="Time relative to the shortest path at full speed."
    )
    smoothness: float | None = Field(
        None, description="Spectral arc length of the speed; 0 would be smoothest."
    )
    clearance_min: float | None = Field(
        None, description="Least gap at the ends of steps, on the lattice of pixels."
    )
    clearance_mean: float | None = Field(
        None, description="Mean gap at the ends of steps."
    )
    smallest_gap: Gap | None = Field(
        None, description="Smallest gap between body and obstacles, with its place."
    )
    gap: float | None = Field(None, description="Narrowest passage of the world.")
    detour: float | None = None
    in_sight: float | None = None
    density: float | None = None
    movers: int = 0
    mover_speed: float = Field(
        0.0, description="Mean speed of the movers, as a part of the robot's."
    )
    contact: Contact | None = Field(None, description="What was touched.")
    cause: Cause | None = None
    step: int | None = Field(None, description="Step of the failure.")
    x: float | None = None
    y: float | None = None
    side: str | None = Field(None, description="Side of the body that was hit.")
    text: str | None = None
    error: str | None = None
    cpu_seconds: float = 0.0

    @property
    def success(self) -> bool:
        """Whether the goal was reached without contact."""
        return self.outcome == "reached" and not self.collisions

    @property
    def touched(self) -> bool:
        """Whether something was touched."""
        return self.outcome == "collision" or self.collisions > 0

    @property
    def number(self) -> int:
        """Its seed, or the number of its world."""
        number = self.index if self.seed is None else self.seed
        assert number is not None
        return number

    @property
    def least_gap(self) -> float | None:
        """Its smallest gap; of an older record, the least at the ends of steps."""
        found = self.smallest_gap
        return self.clearance_min if found is None else found.gap

    @property
    def gap_left(self) -> float:
        """Its smallest gap; 0 after a failure."""
        return self.least_gap or 0.0 if self.success else 0.0

    @property
    def close_gap(self) -> Gap | None:
        """The smallest gap that was too close; None without any."""
        return None if self.smallest_gap is None else self.smallest_gap.close

    @property
    def too_close(self) -> bool:
        """Whether it reached the goal, but came too close to an obstacle."""
        return self.success and self.close_gap is not None


class Scores(StrictRecord):
    """Means over a fixed number of episodes, each in [0, 1]."""

    success: float
    time: float = Field(description="Success weighted by completion time, SCT.")
    path: float = Field(description="Success weighted by path length, SPL.")
    barn: float = Field(description="The metric of BARN, at most 0.5.")


def scores_of(rows: Sequence[EpisodeRow]) -> Scores:
    """The mean scores of some episodes; at least one."""
    return Scores(
        success=fmean(row.success for row in rows),
        time=fmean(row.time_score for row in rows),
        path=fmean(row.path_score for row in rows),
        barn=fmean(row.barn_score for row in rows),
    )


def driven_row(
    rollout: Rollout,
    task: Nominal,
    facts: dict[str, Any],
    *,
    units: Units,
    shown: Units | None,
    told: bool,
    cpu_seconds: float,
) -> EpisodeRow:
    """The row of an episode that was driven.

    Args:
        rollout: The episode.
        task: Its task, with its start and goal.
        facts: What the row says of its world or seed, with `length`, `least_steps` and
            `barn_steps`, the steps of the shortest path at full speed.
        units: Units of the environment.
        shown: Units of diagnoses; None for those of the environment.
        told: Whether there may be more of a diagnosis than the cause.
        cpu_seconds: CPU time of the policy, s.
    """
    trajectory, distances = rollout.trajectory, rollout.distances()
    legs = np.hypot(*np.diff(trajectory.poses[:, :2], axis=0).T)
    success = rollout.reached and not rollout.collisions
    driven, steps = float(legs.sum()), trajectory.steps
    gaps = np.maximum(rollout.rooms - rollout.radius, 0.0)
    digits = units.digits
    row = EpisodeRow(
        **plan_facts(success, steps, driven, facts),
        outcome=rollout.outcome,
        collisions=rollout.collisions,
        horizon=task.horizon,
        lost=losses_of(
            trajectory,
            task.full_step,
            2.0 * task.full_step / task.axle_length,
            facts["least_steps"],
            success=success,
        ),
        seconds=round(steps * trajectory.dt, _DIGITS),
        d0=round(float(distances[0]), digits),
        d_min=round(float(distances.min()), digits),
        clearance_min=round(float(gaps.min()), _DIGITS) if gaps.size else None,
        clearance_mean=round(float(gaps.mean()), _DIGITS) if gaps.size else None,
        smallest_gap=gap_of(rollout, task, told=told),
        contact=rollout.contact,
        error=rollout.error,
        cpu_seconds=round(cpu_seconds, 3),
    )
    if not success:
        found = diagnose(rollout, task, shown).model_dump(include=_FAILURE)
        return row.model_copy(update=found if told else {"cause": found["cause"]})
    length, rest = facts["length"], float(trajectory.path_distances[-1])
    ratios = {
        "path_ratio": (driven + rest) / length,
        "time_ratio": steps * task.full_step / length,
        "smoothness": spectral_arc_length(legs / trajectory.dt, trajectory.dt),
    }
    rounded = {name: round(value, _DIGITS) for name, value in ratios.items()}
    return row.model_copy(update=rounded)


def plan_facts(
    success: bool, steps: int, driven: float, facts: dict[str, Any]
) -> dict[str, Any]:
    """The fields of a row that follow from its steps, its path, and its world."""
    about = {name: value for name, value in facts.items() if name != "barn_steps"}
    return {
        **about,
        "steps": steps,
        "driven": round(driven, _DIGITS),
        "time_score": time_score(success, steps, facts["least_steps"]),
        "path_score": path_score(success, driven, facts["length"]),
        "barn_score": barn_score(success, steps, facts["barn_steps"]),
    }
