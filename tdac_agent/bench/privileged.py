"""Planners that know the true world and all movers: a reference, not a competitor.

These are the planners that admit worlds to a set. Among discs that bounce it is the
earliest arrival on a lattice in space and time, with turns that take no time; among
people it is a driver by ORCA.
"""

from __future__ import annotations

from pathlib import Path

from tdac_agent.tasks.provenance import sha256_of
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder import orca_driver, space_time
from tdac_envs.ladder.task_sets import TaskSet

PRIVILEGED = "privileged"
"""The word for this entrant."""


def planner_sha256() -> str:
    """Hash of the planners' source code."""
    files = (space_time.__file__, orca_driver.__file__)
    return sha256_of(b"".join(Path(file).read_bytes() for file in files))


def check_movers(tasks: TaskSet) -> None:
    """Checks that a set has movers.

    Raises:
        TaskError: It has none.
    """
    if not tasks.file.movers:
        raise TaskError(
            "without movers, a planner that knows the world takes the least possible "
            "time: its time score is 1 by definition"
        )
