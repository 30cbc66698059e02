"""Start, goal and path as SVG over the picture of a map or world."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tdac_agent.studio.bottleneck import Bottleneck
from tdac_agent.studio.draft import Checked, TaskDraft
from tdac_agent.studio.source_view import SourceView
from tdac_envs.worlds.bodies import BODY_RADIUS

PATH, ROBOT, GOAL, NARROW = "#5848c6", "#5848c6", "#12694a", "#d55e00"
BAR = 4.0
"""Half length of the bars at the ends of a passage, in widths of a thin line."""


def overlay(view: SourceView, draft: TaskDraft, checked: Checked | None) -> str:
    """The marks of a draft."""
    thick = max(view.width, view.height) / 400
    parts = []
    if checked is not None and len(checked.path) > 1:
        parts.append(_polyline(view, checked.path, thick))
    if checked is not None and checked.narrowest is not None:
        parts.append(_gap(view, checked.narrowest, thick))
    if draft.goal is not None:
        ((x, y),) = view.at([draft.goal]).tolist()
        size = 5 * thick
        if checked is not None and checked.task is not None:
            reach = checked.task.nominal.goal_tolerance * view.scale[0]
            parts.append(_circle(x, y, reach, f"{GOAL}30", GOAL, 0.6 * thick))
        parts.append(_circle(x, y, size, "none", GOAL, 1.6 * thick))
        parts.append(_circle(x, y, 0.4 * size, GOAL, "none", 0))
    start = draft.start or (view.start[:2] if view.start else None)
    if start is not None:
        parts += _robot(view, start, draft, thick)
    return "".join(parts)


def _robot(
    view: SourceView, start: tuple[float, float], draft: TaskDraft, thick: float
) -> list[str]:
    """The body at the start, with a line towards its heading."""
    ((x, y),) = view.at([start]).tolist()
    body = draft.radius if draft.radius is not None else BODY_RADIUS
    radius = max(body * view.scale[0], 3 * thick)
    heading = draft.heading or 0.0
    ahead = np.add(start, [math.cos(heading), math.sin(heading)])
    ((to_x, to_y),) = view.at([ahead]).tolist()
    far = math.hypot(to_x - x, to_y - y) or 1.0
    reach = 1.6 * radius / far
    end = x + reach * (to_x - x), y + reach * (to_y - y)
    return [
        _circle(x, y, radius, f"{ROBOT}59", ROBOT, thick),
        f'<line x1="{x:.1f}" y1="{y:.1f}" x2="{end[0]:.1f}" y2="{end[1]:.1f}" '
        f'stroke="{ROBOT}" stroke-width="{1.6 * thick:.2f}" stroke-linecap="round"/>',
    ]


def _gap(view: SourceView, narrowest: Bottleneck, thick: float) -> str:
    """A passage: a line between its ends, with a bar across each end."""
    (x, y), (to_x, to_y) = view.at(narrowest.ends).tolist()
    far = math.hypot(to_x - x, to_y - y) or 1.0
    over, down = ((to_y - y) / far, (x - to_x) / far)
    lines = [(x, y, to_x, to_y)]
    for at_x, at_y in ((x, y), (to_x, to_y)):
        more_x, more_y = BAR * thick * over, BAR * thick * down
        lines.append((at_x - more_x, at_y - more_y, at_x + more_x, at_y + more_y))
    path = " ".join(f"M{a:.1f},{b:.1f}L{c:.1f},{d:.1f}" for a, b, c, d in lines)
    # A light edge tells it from walls and from the path.
    return "".join(
        f'<path d="{path}" class="gap" fill="none" stroke="{colour}" '
        f'stroke-width="{width * thick:.2f}" stroke-linecap="round"/>'
        for colour, width in (("white", 3.4), (NARROW, 1.8))
    )


def _polyline(view: SourceView, path: Any, thick: float) -> str:
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in view.at(path).tolist())
    return (
        f'<polyline points="{points}" fill="none" stroke="{PATH}" '
        f'stroke-width="{1.4 * thick:.2f}" stroke-dasharray="{5 * thick:.1f}"/>'
    )


def _circle(
    x: float, y: float, radius: float, fill: str, stroke: str, width: float
) -> str:
    return (
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}" fill="{fill}" '
        f'stroke="{stroke}" stroke-width="{width:.2f}"/>'
    )
