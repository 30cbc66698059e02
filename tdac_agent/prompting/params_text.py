"""`params.json` as prompts show it."""

from __future__ import annotations

import json
from typing import Any

_SHOWN = 2
"""Rays whose angles are shown at each end of a long list."""


def params_text(params: dict[str, Any]) -> str:
    """Formats the contents of `params.json`; of many ray angles, the first and last."""
    robot = params.get("robot", {})
    angles = robot.get("ray_angles")
    if angles is not None and len(angles) > 2 * _SHOWN:
        first, last = angles[:_SHOWN], angles[-_SHOWN:]
        robot = {**robot, "ray_angles": [*first, "...", *last]}
        params = {**params, "robot": robot}
    return json.dumps(params, indent=2)
