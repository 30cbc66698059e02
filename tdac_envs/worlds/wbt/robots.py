"""Recognises e-pucks and reads their poses."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

import numpy as np

from tdac_envs.worlds.wbt.fields import child, children, flag, numbers, text
from tdac_envs.worlds.wbt.frames import NodeFrame
from tdac_envs.worlds.wbt.placing import placed
from tdac_envs.worlds.wbt.tree import WbtNode
from tdac_envs.worlds.world import EPuck

ROBOTS = {"Robot", "Supervisor", "DifferentialWheels", "CustomRobot"}
_WITHIN = ("children", "endPoint", "device", "boundingObject")
_EPUCK = re.compile(r"e[-_ ]?puck", re.IGNORECASE)


def is_epuck(node: WbtNode) -> bool:
    """Whether a node is an e-puck: the PROTO, or a Robot with its model or sensors."""
    if node.kind not in ROBOTS:
        return _EPUCK.fullmatch(node.kind) is not None
    if _EPUCK.search(text(node, "model")):
        return True
    names = {text(part, "name") for part in inside(node) if "name" in part.fields}
    return {f"ps{k}" for k in range(8)} <= names


def epuck(node: WbtNode, frame: NodeFrame) -> EPuck:
    """Reads an e-puck.

    Raises:
        WorldError: A field is invalid.
    """
    own = placed(node, frame)
    ahead = _ahead(node, own) if node.kind in ROBOTS else None
    x, y, z = own.origin.tolist()
    return EPuck(
        name=text(node, "name", "e-puck"),
        x=x,
        y=y,
        heading=own.flu().heading if ahead is None else math.atan2(ahead[1], ahead[0]),
        z=z,
        version="2" if text(node, "version") == "2" else "1",
        controller=text(node, "controller"),
        # A Robot node does not have this field.
        kinematic=node.kind not in ROBOTS and flag(node, "kinematic", False),
    )


def inside(node: WbtNode) -> Iterator[WbtNode]:
    """The node and all nodes in its children, joints, devices and boundingObject."""
    stack, seen = [node], set()
    while stack:
        part = stack.pop()
        if id(part) not in seen:
            seen.add(id(part))
            yield part
            for name in _WITHIN:
                stack.extend(children(part, name))


def _ahead(node: WbtNode, frame: NodeFrame) -> tuple[float, float] | None:
    """Direction of the robot's axis that points to its front sensors, ps0 and ps7.

    A Robot node keeps the axes of the Webots version that it was written for, which may
    differ from the version of the file.
    """
    front = {
        text(part, "name"): numbers(part, "translation", (0.0, 0.0, 0.0))
        for part in inside(node)
        if "translation" in part.fields and text(part, "name") in {"ps0", "ps7"}
    }
    if len(front) != 2:
        return None
    forward = frame.matrix @ np.array(list(front.values())).sum(axis=0)
    axes = np.vstack([frame.matrix[:2].T, -frame.matrix[:2].T])
    x, y = axes[int((axes @ forward[:2]).argmax())].tolist()
    return (x, y) if math.hypot(x, y) > 0.5 else None


def has_body(node: WbtNode) -> bool:
    """Whether a robot can be hit: it or a part of it has a boundingObject."""
    return any(
        "boundingObject" in part.fields and child(part, "boundingObject") is not None
        for part in inside(node)
    )
