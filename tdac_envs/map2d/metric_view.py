"""Observations and infos in metres of a map's frame, as in ROS.

The simulation uses pixels in either case; this is a conversion at its border.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from tdac_envs.grid.map_units import MapFrame
from tdac_envs.map2d.observed import info_of

Array = NDArray[np.float64]
Seen = dict[str, NDArray[np.float32]]

LENGTHS = ("distance_to_goal", "path_distance", "clearance")
"""Entries of `info` that are lengths."""
_SLACK = np.float32(1e-6)
"""Least distance of the bounds of a rotated map from its corners, m."""


class MetricView:
    """What a robot observes in metres, or what each of many robots observes.

    Places are in the frame of the map (`map.yaml`), headings and turns are
    counter-clockwise. The order of the rays stays: the first is the leftmost.

    Args:
        frames: Frame of the map, or those of the robots' maps.
    """

    def __init__(self, frames: MapFrame | Sequence[MapFrame]) -> None:
        if isinstance(frames, MapFrame):
            columns = np.array(_numbers(frames))
        else:
            columns = np.array([_numbers(frame) for frame in frames]).T
        self._resolution, self._height, self._x, self._y = columns[:4]
        self._yaw, self._cosine, self._sine = columns[4:]

    def seen(self, whole: Seen, robots: Any = ...) -> Seen:
        """The observations of a robot, or of some of many, converted from px.

        Args:
            whole: Observations, with a first axis for robots if there are many.
            robots: Which robots these are; all by default.
        """
        scale = self._resolution[robots]
        own = {
            **whole,
            "pose": self._poses(whole["pose"], robots),
            "goal": self._poses(whole["goal"], robots),
            "ranges": (whole["ranges"] * scale[..., None]).astype(np.float32),
        }
        if "odometry" in whole:
            # A turn to the right is positive in pixels, and negative in metres.
            factors = np.stack([scale, np.full_like(scale, -1.0)], axis=-1)
            own["odometry"] = (whole["odometry"] * factors).astype(np.float32)
        return own

    def info(self, whole: dict[str, Any]) -> dict[str, Any]:
        """The infos of a robot, or of all, with lengths in metres."""
        lengths = {key: whole[key] * self._resolution for key in LENGTHS}
        own = {**whole, **lengths}
        return own if self._resolution.ndim else {**own, **_floats(lengths)}

    def info_of(self, outcome: list[float]) -> dict[str, Any]:
        """The `info` of a step in metres, from its `outcome` as a list."""
        return self.info(info_of(outcome))

    def space(self, whole: spaces.Dict) -> spaces.Dict:
        """The observation space of a robot, converted from px."""
        boxes: dict[str, Any] = dict(whole.spaces)
        low, high = boxes["goal"].low, boxes["goal"].high
        corners = [[x, y] for x in (low[0], high[0]) for y in (low[1], high[1])]
        places = np.array([self._poses(np.array(corner)) for corner in corners])
        least, most = places.min(axis=0), places.max(axis=0)
        if self._yaw:  # the last bit of a place at the rim may differ
            least -= np.maximum(np.spacing(np.abs(least)), _SLACK)
            most += np.maximum(np.spacing(np.abs(most)), _SLACK)
        pi = np.float32(math.pi)
        boxes["pose"] = spaces.Box(np.append(least, -pi), np.append(most, pi))
        boxes["goal"] = spaces.Box(least, most)
        reach = (boxes["ranges"].high * self._resolution).astype(np.float32)
        boxes["ranges"] = spaces.Box(np.zeros_like(reach), reach)
        if "odometry" in boxes:
            far, turn = boxes["odometry"].high.tolist()
            limits = np.array([far * self._resolution, turn], np.float32)
            boxes["odometry"] = spaces.Box(-limits, limits)
        return spaces.Dict(boxes)

    def _poses(self, given: NDArray[Any], robots: Any = ...) -> NDArray[np.float32]:
        """Places, shape (..., 2), or poses, shape (..., 3), of px in metres."""
        rows = np.asarray(given, np.float64)
        scale, height = self._resolution[robots], self._height[robots]
        cosine, sine = self._cosine[robots], self._sine[robots]
        right = (rows[..., 0] + 0.5) * scale
        up = (height - 0.5 - rows[..., 1]) * scale
        columns = [
            self._x[robots] + cosine * right - sine * up,
            self._y[robots] + sine * right + cosine * up,
        ]
        if rows.shape[-1] == 3:
            turned = self._yaw[robots] - rows[..., 2]
            columns.append(math.pi - np.mod(math.pi - turned, 2.0 * math.pi))
        return np.stack(columns, axis=-1).astype(np.float32)


def _numbers(frame: MapFrame) -> tuple[float, ...]:
    """Resolution, height, origin; cosine and sine of its yaw."""
    yaw = frame.origin[2]
    # From `math`: NumPy's may differ between a scalar and an array.
    return (
        *(frame.resolution, frame.height, *frame.origin),
        *(math.cos(yaw), math.sin(yaw)),
    )


def _floats(values: dict[str, Any]) -> dict[str, float]:
    return {key: float(value) for key, value in values.items()}
