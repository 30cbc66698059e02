"""What a robot of a task set observes: keys, frame of reference, infos."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from tdac_envs.ladder.set_file import SetFile

Array = NDArray[np.float64]
Seen = dict[str, NDArray[np.float32]]

ALWAYS, AT_END = ("collisions", "clipped"), ("is_success", "collision")
"""Entries of `info`: in every step, and in the last one of an episode."""
ANCHOR = 7
"""Numbers of an anchor; see `SetView.anchor`."""


class SetView:
    """What is observed in a set, for one robot or for many.

    Worlds are in px, with y down. In a set with a resolution, the robot observes
    metres, y is up (in the start frame: to the left), and turns to the left are
    positive, as in ROS.

    Args:
        file: The set.
        side: Largest width or height of its worlds, px or m.
        privileged: Whether infos are complete, with the true pose.
    """

    def __init__(self, file: SetFile, side: float, privileged: bool) -> None:
        self._keys = tuple(sorted(file.observed))
        self._from_start = file.frame == "start"
        # Worlds of an e-puck have their origin in the middle.
        self._low = -side / 2 if file.is_epuck else -0.5
        self._side = side
        self._is_metric = file.resolution is not None
        self._scale = file.per_unit
        turn = -1.0 if self._is_metric else 1.0
        self._signs = np.array([self._scale, turn * self._scale])
        self._turns = np.array([self._scale, turn])
        self.privileged = privileged

    def space(self, whole: spaces.Dict) -> spaces.Dict:
        """The observation space: the same for all worlds of the set.

        Args:
            whole: The space of the environment of one world.
        """
        if self._from_start:
            far = self._scale * math.hypot(self._side, self._side)
            low, high = np.full(2, -far, np.float32), np.full(2, far, np.float32)
        else:
            least = 0.0 if self._is_metric else self._low
            low = np.full(2, least, np.float32)
            high = np.full(2, least + self._scale * self._side, np.float32)
        pi = np.float32(math.pi)
        own = {
            **whole.spaces,
            "pose": spaces.Box(np.append(low, -pi), np.append(high, pi)),
            "goal": spaces.Box(low, high),
        }
        if self._is_metric:
            own |= {
                key: _scaled(own[key], factors)
                for key, factors in (
                    ("ranges", self._scale),
                    ("odometry", np.abs(self._turns)),
                )
                if key in own
            }
        return spaces.Dict({key: own[key] for key in self._keys})

    def anchor(self, task: Any) -> Array:
        """Where an episode's frame of reference is, and its goal, shape (7,).

        They are x, y, heading of the frame, cosine and sine of this heading, and the
        goal as it is observed.
        """
        x, y, heading = task.start if self._from_start else self._corner(task)
        # From `math`: NumPy's may differ between a scalar and an array.
        cosine, sine = math.cos(heading), math.sin(heading)
        dx, dy = task.goal[0] - x, task.goal[1] - y
        goal = np.array([cosine * dx + sine * dy, cosine * dy - sine * dx])
        if self._is_metric:
            goal = goal * self._signs + 0.0  # not -0.0
        return np.array([x, y, heading, cosine, sine, *goal])

    def _corner(self, task: Any) -> tuple[float, float, float]:
        """Origin and heading of the map's frame: in metres its lower left corner."""
        if not self._is_metric:
            return 0.0, 0.0, 0.0
        return -0.5, task.terrain.grid.cells.shape[0] - 0.5, 0.0

    def seen(self, whole: Seen, poses: Array, anchors: Array) -> Seen:
        """The observations of one robot, or of many with an additional first axis.

        Args:
            whole: What the environment of one world observes.
            poses: The poses as they are observed, in the world, shape (..., 3).
            anchors: See `anchor`, shape (..., 7).
        """
        own = {**whole, **self.placed(poses, anchors)}
        return self.chosen(self.sensed(own))

    def chosen(self, whole: Seen) -> Seen:
        """The entries that are observed."""
        return {key: whole[key] for key in self._keys}

    def sensed(self, whole: Seen) -> Seen:
        """The same with ranges and odometry in the units of the set."""
        if not self._is_metric:
            return whole
        own = {**whole, "ranges": _times(whole["ranges"], self._scale)}
        if "odometry" in whole:
            own["odometry"] = _times(whole["odometry"], self._turns)
        return own

    def placed(self, poses: Array, anchors: Array) -> Seen:
        """The observed goal and pose; arguments as for `seen`."""
        own = {"goal": anchors[..., 5:].astype(np.float32)}
        moves = self._from_start or self._is_metric
        if moves and "pose" in self._keys:
            turned = poses[..., 2] - anchors[..., 2]
            if self._is_metric:
                turned = 0.0 - turned
            turned = np.where(turned > math.pi, turned - 2.0 * math.pi, turned)
            turned = np.where(turned <= -math.pi, turned + 2.0 * math.pi, turned)
            places = _moved(poses[..., :2], anchors)
            if self._is_metric:
                places = places * self._signs + 0.0  # not -0.0
            joined = np.concatenate([places, turned[..., None]], axis=-1)
            own["pose"] = joined.astype(np.float32)
        return own

    def info(self, whole: dict[str, Any], pose: Array, ended: bool) -> dict[str, Any]:
        """The info of one robot.

        Args:
            whole: What the environment of one world tells.
            pose: True pose, shape (3,).
            ended: Whether the episode has ended.
        """
        if self.privileged:
            return {**whole, "pose": pose}
        return {key: whole[key] for key in (*ALWAYS, *(AT_END if ended else ()))}

    def infos(
        self, whole: dict[str, Any], poses: Array, ended: NDArray[np.bool_]
    ) -> dict[str, Any]:
        """The infos of many robots, in Gymnasium's format.

        Args:
            whole: What the environments of one world tell.
            poses: True poses, shape (n, 3).
            ended: Which episodes have ended, shape (n,).
        """
        mask = whole[f"_{ALWAYS[0]}"]
        if self.privileged:
            shown = np.where(mask[:, None], poses, 0.0)
            return {**whole, "pose": shown, "_pose": mask.copy()}
        own: dict[str, Any] = {}
        for key in ALWAYS:
            own[key], own[f"_{key}"] = whole[key], mask.copy()
        if ended.any():
            for key in AT_END:
                own[key], own[f"_{key}"] = whole[key] & ended, ended.copy()
        return own


def joined(each: Mapping[int, Mapping[str, Any]], count: int) -> dict[str, Any]:
    """The infos of some robots as those of a batch, in Gymnasium's format.

    Args:
        each: The infos by the number of the robot; all have the same keys.
        count: Number of robots.
    """
    infos: dict[str, Any] = {}
    mask = np.zeros(count, np.bool_)
    mask[list(each)] = True
    for key, first in next(iter(each.values()), {}).items():
        values = {i: info[key] for i, info in each.items()}
        if isinstance(first, Mapping):
            infos[key] = joined(values, count)
        else:
            infos[key] = np.full(count, None, object)
            if isinstance(first, int | float):
                infos[key] = np.zeros(count, type(first))
            infos[key][list(values)] = list(values.values())
        infos[f"_{key}"] = mask.copy()
    return infos


def _times(values: NDArray[np.float32], factors: Any) -> NDArray[np.float32]:
    """The product in double precision, as float32."""
    return np.asarray(values.astype(np.float64) * factors).astype(np.float32)


def _scaled(box: spaces.Space[Any], factors: Any) -> spaces.Box:
    """A box with its bounds multiplied."""
    assert isinstance(box, spaces.Box)
    return spaces.Box(_times(box.low, factors), _times(box.high, factors))


def _moved(points: Array, anchors: Array) -> Array:
    """Points, shape (..., 2), in the frames of the anchors."""
    dx, dy = points[..., 0] - anchors[..., 0], points[..., 1] - anchors[..., 1]
    cosine, sine = anchors[..., 3], anchors[..., 4]
    return np.stack([cosine * dx + sine * dy, cosine * dy - sine * dx], axis=-1)
