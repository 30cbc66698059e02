"""One picture of a task with the trajectories of all policies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.evaluation.evaluation_report import Result
from tdac_agent.tasks.task import Task
from tdac_agent.verification.diagnosis.figures import write_png
from tdac_envs.drawing.backdrop import discs_on
from tdac_envs.drawing.canvas import (
    GREY,
    INK,
    MOVER,
    PAPER,
    Canvas,
    Colour,
    Image,
    blank,
    write_text,
)
from tdac_envs.drawing.marks import draw_movers

# Okabe and Ito's colour-blind-safe palette, without black and yellow.
COLOURS: tuple[Colour, ...] = (
    (0, 114, 178),
    (213, 94, 0),
    (0, 158, 115),
    (204, 121, 167),
    (230, 159, 0),
    (86, 180, 233),
)
_ROW, _SWATCH = 22, 24
# Opacity where all trajectories of a policy overlap.
_COVER = 0.85


@dataclass(frozen=True, slots=True, eq=False)
class Overlay:
    """The trajectories of one policy.

    Attributes:
        label: Name of the policy, and number of successes.
        ways: Poses of each episode, shape (T + 1, 3).
        collided: Whether each episode had a contact.
        movers: Moving obstacles at the end of the first episode; `Trajectory.ghosts`.
    """

    label: str
    ways: Sequence[NDArray[np.float64]]
    collided: Sequence[bool]
    movers: Sequence[NDArray[np.float64]]

    @classmethod
    def of(cls, result: Result, driven: Sequence[Trajectory]) -> Overlay:
        """The overlay of a result, with the trajectory of each episode."""
        reached = sum(episode.success for episode in result.episodes)
        label = f"{result.policy}: {reached} of {len(result.episodes)}"
        ascii_label = label.encode("ascii", "replace").decode()
        touched = [episode.collisions > 0 for episode in result.episodes]
        ways = [each.poses for each in driven]
        ghosts = driven[0].ghosts(driven[0].steps)
        return cls(ascii_label, ways, touched, ghosts)


def draw_overlay(task: Task, overlays: Sequence[Overlay], path: Path) -> None:
    """Writes a PNG of the map or world with the trajectories of all policies."""
    write_png(overlay_picture(task, overlays), path)


def overlay_picture(task: Task, overlays: Sequence[Overlay]) -> Image:
    """The map or world with all trajectories and a legend, uint8 RGB.

    The first policy is on top; a dot marks a contact. Moving obstacles are those at
    the end of the first policy's first episode.
    """
    chart = task.pictures().backdrop().whole()
    canvas, movers = chart.canvas, overlays[0].movers
    draw_movers(canvas, [discs_on(chart, discs) for discs in movers])
    for number, overlay in reversed(list(enumerate(overlays))):
        colour = COLOURS[number % len(COLOURS)]
        places = [
            canvas.to_frame(chart.at(np.asarray(way[:, :2], np.float64)))
            for way in overlay.ways
        ]
        _draw_paths(canvas.image, places, colour)
        _draw_contacts(canvas.image, places, overlay.collided, colour)
    others = [(GREY, "shortest path")]
    if movers:
        others.append((MOVER, "movers at the end (first episode)"))
    return np.vstack([canvas.image, _legend(overlays, others, canvas.image.shape[1])])


def _draw_paths(
    image: Image, paths: Sequence[NDArray[np.float64]], colour: Colour
) -> None:
    """Draws lines, more opaque where more of them overlap."""
    count = np.zeros(image.shape[:2], np.float32)
    for path in paths:
        line = np.zeros(image.shape[:2], np.uint8)
        fixed = np.rint(path * 16.0).astype(np.int32)
        cv2.polylines(line, [fixed], False, 255, 2, cv2.LINE_AA, 4)
        count += line
    # A single path is visible; where all overlap, the opacity is nearly `_COVER`.
    opacity = max(0.25, 1.0 - (1.0 - _COVER) ** (3.0 / max(len(paths), 1)))
    cover = _COVER * (1.0 - (1.0 - opacity) ** (count / 255.0))[..., None]
    image[...] = np.rint(image * (1.0 - cover) + np.array(colour) * cover)


def _draw_contacts(
    image: Image,
    paths: Sequence[NDArray[np.float64]],
    collided: Sequence[bool],
    colour: Colour,
) -> None:
    for path, touched in zip(paths, collided, strict=True):
        if touched:
            x, y = (round(16.0 * value) for value in path[-1])
            cv2.circle(image, (x, y), 72, INK, cv2.FILLED, cv2.LINE_AA, 4)
            cv2.circle(image, (x, y), 52, colour, cv2.FILLED, cv2.LINE_AA, 4)


def _legend(
    overlays: Sequence[Overlay], others: Sequence[tuple[Colour, str]], width: int
) -> Image:
    """Colours and labels, in as many rows as they need."""
    entries = [(COLOURS[n % len(COLOURS)], o.label) for n, o in enumerate(overlays)]
    entries.extend(others)
    rows: list[list[tuple[int, Colour, str]]] = [[]]
    x = 10
    for colour, text in entries:
        taken = _SWATCH + 22 + Canvas.text_width(text)
        if rows[-1] and x + taken > width:
            rows.append([])
            x = 10
        rows[-1].append((x, colour, text))
        x += taken
    strip = blank(12 + _ROW * len(rows), width, PAPER)
    for number, row in enumerate(rows):
        baseline = 21 + _ROW * number
        for x, colour, text in row:
            strip[baseline - 7 : baseline - 3, x : x + _SWATCH - 6] = colour
            write_text(strip, x + _SWATCH, baseline, text, INK)
    return strip
