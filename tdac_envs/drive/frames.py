"""Frames of a batch: one picture for each robot, all of the same size."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Sequence
from typing import Any

import cv2
import numpy as np

from tdac_envs.core.errors import TaskError
from tdac_envs.drawing.canvas import PAPER, Image, blank
from tdac_envs.drive.env import DrivenEnv
from tdac_envs.drive.stepping import REACHED, TOUCHED, TRUNCATED, row_of

MOST_DRAWN = 64
"""Largest number of robots in a batch that can be rendered."""
SIDE = 1280
"""Side of a square into which the frames of all robots fit side by side, px."""


class BatchFrames:
    """Frames of the robots of a batch.

    Args:
        envs: Environments of the batch; robot i is drawn as `envs[i % len(envs)]`.
        robots: Arrays of all robots.
        count: Number of robots.
    """

    def __init__(self, envs: Sequence[DrivenEnv], robots: Any, count: int) -> None:
        # These copies only draw; they are never stepped.
        self._viewers = [copy.copy(envs[i % len(envs)]) for i in range(count)]
        self._largest = SIDE // math.ceil(math.sqrt(count))
        self.bind(robots)

    def bind(self, robots: Any) -> None:
        """From now on, draws the robots of these arrays."""
        for i, viewer in enumerate(self._viewers):
            viewer.robot = row_of(robots, i)

    def begin(self, which: Iterable[int], tasks: Sequence[Any]) -> None:
        """Begins new trails for robots that have been reset.

        Args:
            which: Indices of these robots.
            tasks: Current tasks of all robots.
        """
        for i in which:
            viewer = self._viewers[i]
            scene = viewer._scene if viewer.task is tasks[i] else None
            viewer.task = tasks[i]
            viewer._begin_trail()
            viewer._scene = scene

    def show(self, i: int, **state: Any) -> None:
        """From now on, draws robot i with these attributes of its environment."""
        for name, value in state.items():
            setattr(self._viewers[i], name, value)

    def note(self, which: Iterable[int]) -> None:
        """Adds the last step of some robots to their trails."""
        for i in which:
            viewer = self._viewers[i]
            ends = viewer.robot.outcome[[REACHED, TOUCHED, TRUNCATED]] == 1.0
            viewer._note(*ends.tolist())

    def drawn(self) -> tuple[Image, ...]:
        """A frame of each robot, uint8 (height, width, 3), all of one even size."""
        # Robots with the same task share the map, which takes the longest to draw.
        scenes = {id(v.task): v._scene for v in self._viewers if v._scene is not None}
        frames = []
        for viewer in self._viewers:
            viewer._scene = scenes.get(id(viewer.task))
            frames.append(_fitted(viewer._frame(), self._largest))
            scenes[id(viewer.task)] = viewer._scene
        rows, columns = np.max([frame.shape[:2] for frame in frames], axis=0).tolist()
        return tuple(_padded(frame, rows, columns) for frame in frames)


def frames_of(
    mode: object, envs: Sequence[DrivenEnv], robots: Any, count: int
) -> BatchFrames | None:
    """The frames of a batch with this render mode; None if the mode is None.

    Raises:
        TaskError: Batches do not have this mode, or the batch has too many robots.
    """
    if mode is None:
        return None
    if mode != "rgb_array":
        raise TaskError(
            "a batch renders arrays; expected render_mode None, 'rgb_array', or "
            f"vectorization_mode='sync', got {mode!r}"
        )
    if count > MOST_DRAWN:
        raise TaskError(
            f"a batch of more than {MOST_DRAWN} robots cannot render; expected "
            f"render_mode None or a smaller num_envs, got {count} robots"
        )
    return BatchFrames(envs, robots, count)


def _fitted(frame: Image, largest: int) -> Image:
    """The frame, made smaller if its longer side exceeds `largest`; sides are even."""
    ratio = min(largest / max(frame.shape), 1.0)
    rows, columns = (max(2 * round(side * ratio / 2), 2) for side in frame.shape[:2])
    if (rows, columns) == frame.shape[:2]:
        return frame
    smaller: Any = cv2.resize(frame, (columns, rows), interpolation=cv2.INTER_AREA)
    return np.asarray(smaller, np.uint8)


def _padded(frame: Image, rows: int, columns: int) -> Image:
    """The frame in the middle of a picture of this size."""
    if frame.shape[:2] == (rows, columns):
        return frame
    picture = blank(rows, columns, PAPER)
    top, left = (
        (n - m) // 2 for n, m in zip((rows, columns), frame.shape, strict=False)
    )
    picture[top : top + frame.shape[0], left : left + frame.shape[1]] = frame
    return picture
