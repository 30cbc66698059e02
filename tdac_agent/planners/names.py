"""Names of the planners, for help texts: read without a parser, which takes long."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

FOLDER = Path(__file__).with_name("files")
"""Folder of the planners' files."""
PLANNERS = FOLDER / "planners.yaml"


@cache
def planner_names() -> tuple[str, ...]:
    """The names of all planners: the keys of `planners.yaml`, in its order."""
    # raw read: shipped
    text = PLANNERS.read_text(encoding="utf-8")
    return tuple(re.findall(r"^([a-z][a-z0-9-]*):$", text, re.MULTILINE))


def planner_list() -> str:
    """The names as in a help text."""
    return ", ".join(f"`{name}`" for name in planner_names())
