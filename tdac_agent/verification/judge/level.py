"""A task set for a suite, which then drives in its first public world."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from tdac_envs.ladder.set_limits import CpuSpec

FIRST_WORLD = 0
"""Number of the world of a task set in which suites drive."""


class Level(NamedTuple):
    """A task set whose first world is there instead of a task.

    Attributes:
        set_file: Its set file.
        split: Split of the world.
        cpu: CPU budget of a controller.
    """

    set_file: Path
    split: str
    cpu: CpuSpec
