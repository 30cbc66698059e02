"""Frames of nodes from their translation, rotation and scale."""

from __future__ import annotations

import numpy as np

from tdac_envs.worlds.wbt.fields import LARGEST, StrayError, numbers
from tdac_envs.worlds.wbt.frames import NodeFrame, own_axes
from tdac_envs.worlds.wbt.tree import WbtNode

Point = tuple[float, float, float]

_ORIGIN = (0.0, 0.0, 0.0)
_NO_TURN = (0.0, 0.0, 1.0, 0.0)
_NO_SCALE = (1.0, 1.0, 1.0)


def placed(
    node: WbtNode, frame: NodeFrame, default: Point = _ORIGIN, *, scaled: bool = False
) -> NodeFrame:
    """The frame of a node.

    Args:
        node: The node.
        frame: Frame of its parent.
        default: Translation (forward, left, up), m, if the node has none.
        scaled: Whether to apply the node's `scale` field.

    Raises:
        WorldError: A field is invalid, or its values are too large.
    """
    translation = numbers(node, "translation", own_axes(default, frame.y_up))
    rotation = numbers(node, "rotation", _NO_TURN)
    scale = numbers(node, "scale", _NO_SCALE) if scaled else _NO_SCALE
    found = frame.inside(translation, rotation, scale)
    reach = max(np.abs(found.matrix).max(), np.abs(found.origin).max())
    if not reach <= LARGEST:
        message = f"{node.kind} is placed or scaled beyond {LARGEST:g} m"
        raise StrayError(str(node.error(message)))
    return found
