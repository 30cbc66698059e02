"""Controllers that check a suite: the reference must pass, the others must fail.

All are the same file, which contains the oracle's paths for the starts of one task and
seed; only `policy` differs.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from tdac_agent.tasks.registry import environment
from tdac_agent.tasks.setting import Nominal
from tdac_agent.tasks.units import Point
from tdac_agent.verification.suite.starts import JITTERS, spread_starts

REFERENCE, DO_NOTHING, SLOW = "reference", "do-nothing", "slow"
POLICIES = {
    REFERENCE: '''\
def policy(obs):
    """Follows the path."""
    return steer(obs)''',
    DO_NOTHING: '''\
def policy(obs):
    """Stands still."""
    return 0.0, 0.0''',
    "constant": '''\
def policy(obs):
    """Always drives straight on."""
    return 1.0, 1.0''',
    "random": '''\
DICE = random.Random(0)


def policy(obs):
    """Returns random wheel speeds."""
    return DICE.uniform(-1.0, 1.0), DICE.uniform(-1.0, 1.0)''',
    "raising": '''\
def policy(obs):
    """Raises an error."""
    raise ValueError("this controller always raises")''',
    SLOW: '''\
def policy(obs):
    """Follows the path, but computes for longer than the limit."""
    end = time.process_time() + 2.2 * DT
    while time.process_time() < end:
        math.sqrt(end)
    return steer(obs)''',
}
"""Source of `policy` by the name of the controller."""
BAD = tuple(name for name in POLICIES if name != REFERENCE)


def privileged_controller(
    task: Nominal, paths: Sequence[Sequence[Point]], name: str = REFERENCE
) -> str:
    """Returns the source of a controller that knows the oracle's path from each start.

    Args:
        task: The controller's task.
        paths: Paths from `reference_paths`.
        name: Key of `POLICIES`.
    """
    entry = environment(task.env_id)
    facts = entry.privileged_facts(task)
    templates = Environment(
        loader=FileSystemLoader(entry.folder),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    return templates.get_template("privileged.py.j2").render(
        spacing=float(np.spacing(np.float32(facts["largest"]))),
        ways=paths,
        policy=POLICIES[name],
        **facts,
    )


def reference_paths(task: Nominal, seed: int) -> list[list[Point]]:
    """Returns the reference path from each start of a verification with this seed."""
    starts = (task.start, *spread_starts(task, seed, JITTERS))
    find = environment(task.env_id).reference_path
    return [find(task, start.x, start.y) for start in starts]
