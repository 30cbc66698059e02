"""What a check of a draft found, in sentences."""

from __future__ import annotations

import math

from tdac_agent.studio.draft import Checked, TaskDraft
from tdac_agent.studio.source_view import SourceView
from tdac_envs.grid.plan import path_length

LEAST_RADIUS, RADIUS_STEP = 1.0, 0.5
"""Of the slider for the robot's radius, px."""
ELSEWHERE = 0.5
"""By how much half of a passage must be less than the widest radius, px, if that gets
through elsewhere: it is measured between walls, the radius from pixel to pixel."""


def fitting_radius(draft: TaskDraft, checked: Checked | None) -> float | None:
    """The largest radius of the slider that gets through; None if that is no help."""
    if checked is None or checked.widest is None or draft.radius is None:
        return None
    fitting = math.floor(checked.widest / RADIUS_STEP) * RADIUS_STEP
    return fitting if LEAST_RADIUS <= fitting < draft.radius else None


def sentence_of(checked: Checked, view: SourceView) -> tuple[str, bool]:
    """What was found, and whether it is good."""
    if checked.task is None:
        return checked.problem, False
    reach = checked.task.nominal.goal_tolerance
    text = (
        f"A path of {path_length(checked.path):.4g} {view.unit}; the goal is reached "
        f"within {reach:.3g} {view.unit} (green disc)"
    )
    return f"{text}.{_about_passage(checked, view.unit)}", True


def _about_passage(checked: Checked, unit: str) -> str:
    """How wide the narrowest passage of the path is, and for which robots."""
    narrowest, widest = checked.narrowest, checked.widest
    if narrowest is None:
        return ""
    if narrowest.at != "path":
        away = narrowest.width / 2.0
        text = f"It is narrowest at the {narrowest.at}, {away:.3g} {unit} from a wall"
    else:
        text = f"Its narrowest passage (bar) is {narrowest.width:.3g} {unit} wide"
    if widest is None:
        return f" {text}."
    if narrowest.width / 2.0 > widest - ELSEWHERE:
        return f" {text}: room for a radius of {widest:g} {unit}."
    return f" {text}; another path has room for a radius of {widest:g} {unit}."
