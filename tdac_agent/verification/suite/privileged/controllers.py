"""The source of the privileged controllers of a task."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from tdac_agent.tasks.setting import Nominal
from tdac_agent.verification.suite.contract import time_step
from tdac_agent.verification.suite.reference import Point, oracle_path, pull
from tdac_agent.verification.suite.starts import JITTERS, spread_starts
from tdac_envs.map2d.task import Map2DTask

if TYPE_CHECKING:
    from tdac_envs.epuck.task import EPuckTask

REFERENCE, DO_NOTHING, SLOW = "reference", "do-nothing", "slow"
POLICIES = {
    REFERENCE: '''\
def policy(obs):
    """Follows the way."""
    return steer(obs)''',
    DO_NOTHING: '''\
def policy(obs):
    """Stands still."""
    return 0.0, 0.0''',
    "constant": '''\
def policy(obs):
    """Drives straight on, whatever comes."""
    return 1.0, 1.0''',
    "random": '''\
DICE = random.Random(0)


def policy(obs):
    """Rolls the dice."""
    return DICE.uniform(-1.0, 1.0), DICE.uniform(-1.0, 1.0)''',
    "raising": '''\
def policy(obs):
    """Gives up."""
    raise ValueError("this controller always raises")''',
    SLOW: '''\
def policy(obs):
    """Follows the way, but computes for longer than a call may."""
    end = time.process_time() + 2.2 * DT
    while time.process_time() < end:
        math.sqrt(end)
    return steer(obs)''',
}
"""Definition of `policy` in each controller, by the controller's name."""
BAD = tuple(name for name in POLICIES if name != REFERENCE)
# Room kept beyond the body on a shortcut, px: many times what float32 rounds away.
SAFE = 0.02


def privileged_controller(
    task: Nominal, ways: Sequence[Sequence[Point]], name: str = REFERENCE
) -> str:
    """Source of a controller that knows the oracle's path from each start of a test.

    Args:
        task: What it must do, or fail to do.
        ways: From `reference_ways`.
        name: One of `POLICIES`.
    """
    if isinstance(task, Map2DTask):
        size = max(task.terrain.grid.cells.shape)
        facts = {"robot": task.robot, "dt": task.dt}
        return _render("controller_map2d.py.j2", name, ways, float(size), facts)
    world = _epuck(task)
    size = max(map(abs, world.ground.bounds))
    facts = {
        "time_step": time_step(world.dt),
        "max_wheel_speed": world.max_wheel_speed,
        "goal_tolerance": world.goal_tolerance,
    }
    return _render("controller_epuck.py.j2", name, ways, size, facts)


def _render(
    template: str,
    name: str,
    ways: Sequence[Sequence[Point]],
    size: float,
    facts: dict[str, Any],
) -> str:
    environment = Environment(
        loader=PackageLoader("tdac_agent", "verification/suite/privileged"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    return environment.get_template(template).render(
        spacing=float(np.spacing(np.float32(size))),
        ways=ways,
        policy=POLICIES[name],
        **facts,
    )


def reference_ways(task: Nominal, seed: int) -> list[list[Point]]:
    """The points to drive to from each start of a verification with this seed."""
    starts = (task.start, *spread_starts(task, seed, JITTERS))
    return [reference_way(task, start.x, start.y) for start in starts]


def reference_way(task: Nominal, x: float, y: float) -> list[Point]:
    """The oracle's path from (x, y) to the goal, pulled taut; ends included."""
    if isinstance(task, Map2DTask):
        path = pull(task, oracle_path(task, x, y), SAFE)
    else:
        from tdac_agent.environments.epuck.reference import epuck_way

        path = epuck_way(_epuck(task), x, y)
    return without_flat_points(path)


def _epuck(task: Nominal) -> EPuckTask:
    from tdac_envs.epuck.task import EPuckTask

    if not isinstance(task, EPuckTask):
        raise TypeError(f"expected an EPuckTask, got {type(task).__name__}")
    return task


def without_flat_points(points: Sequence[Point]) -> list[Point]:
    """A polyline without the points at which it goes straight on."""
    kept = list(points[:1])
    for here, after in pairwise(points[1:]):
        (x0, y0), (x1, y1), (x2, y2) = kept[-1], here, after
        ax, ay, bx, by = x1 - x0, y1 - y0, x2 - x1, y2 - y1
        if ax * by != ay * bx or ax * bx + ay * by <= 0.0:
            kept.append(here)
    return [*kept, *points[1:][-1:]]
