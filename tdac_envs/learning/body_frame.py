"""Places as a robot sees them: ahead and to its left."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def seen_from(poses: ArrayLike, places: ArrayLike, up: bool) -> NDArray[np.float64]:
    """Points in the robot's frame: distances ahead and to its left.

    Args:
        poses: Shape (…, 3): x, y, heading.
        places: Shape (…, 2).
        up: Whether y points up, and headings are counter-clockwise.
    """
    pose = np.asarray(poses, np.float64)
    dx, dy = np.moveaxis(np.asarray(places) - pose[..., :2], -1, 0)
    cos, sin = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    left = dy * cos - dx * sin
    return np.stack([dx * cos + dy * sin, left if up else -left], axis=-1)
