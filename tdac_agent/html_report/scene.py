"""The background of an animation: a small picture of the map or world."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from tdac_agent.tasks.task import Task
from tdac_envs.drawing.backdrop import Backdrop, Chart
from tdac_envs.drawing.canvas import Image as Picture

LARGEST = 880
COLOURS = 48


@dataclass(frozen=True, slots=True, eq=False)
class TaskPicture:
    """A picture of a task, and the mapping of poses to it.

    Attributes:
        picture: PNG as a data URL.
        width: Width, px.
        height: Height, px.
        radius: Radius of the body, px.
        chart: Chart of the drawing that the picture was made from.
        zoom: Picture px per px of the drawing.
    """

    picture: str
    width: int
    height: int
    radius: float
    chart: Chart
    zoom: float

    def at(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Converts poses to px of the picture, with unwrapped clockwise headings.

        Args:
            poses: Shape (n, 3), or (n, 2) for positions, in px or m.
        """
        frame = self.chart.canvas.to_frame(self.chart.at(poses[:, :2]))
        places = (frame + 0.5) * self.zoom
        if poses.shape[1] == 2:
            return places
        turn = 1.0 if self.chart.turned(1.0) > 0 else -1.0
        return np.column_stack([places, turn * np.unwrap(poses[:, 2])])


def scene_of(task: Task) -> TaskPicture:
    """Draws the map or world with start, goal and shortest path."""
    return picture_of(task.pictures().backdrop())


def picture_of(backdrop: Backdrop) -> TaskPicture:
    """Draws a map or world on which robots drive."""
    chart = backdrop.whole()
    drawn = chart.canvas.image[: chart.canvas.strip_top]
    zoom = min(1.0, LARGEST / max(drawn.shape[:2]))
    height, width = (max(1, round(zoom * side)) for side in drawn.shape[:2])
    return TaskPicture(
        data_address(_png(drawn, width, height), "image/png"),
        width,
        height,
        backdrop.radius * chart.scale * zoom,
        chart,
        zoom,
    )


def data_address(content: bytes, kind: str) -> str:
    """Encodes a file as a data URL of some MIME type."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def _png(drawn: Picture, width: int, height: int) -> bytes:
    small = Image.fromarray(drawn).resize((width, height), Image.Resampling.BOX)
    stream = io.BytesIO()
    # Few colours make the file several times smaller without a visible loss.
    small.quantize(COLOURS).save(stream, "PNG", optimize=True)
    return stream.getvalue()
