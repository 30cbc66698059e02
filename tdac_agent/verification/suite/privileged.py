"""Controllers that put a suite to the proof: one that must pass, others that must not.

All are one file that knows the oracle's path for the starts of one task and seed, and
differ in their `policy` alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from tdac_agent.tasks.registry import environment
from tdac_agent.tasks.setting import Nominal
from tdac_agent.verification.suite.reference import Point
from tdac_agent.verification.suite.starts import JITTERS, spread_starts

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


def privileged_controller(
    task: Nominal, paths: Sequence[Sequence[Point]], name: str = REFERENCE
) -> str:
    """Source of a controller that knows the oracle's path from each start of a test.

    Args:
        task: What it must do, or fail to do.
        paths: From `reference_paths`.
        name: One of `POLICIES`.
    """
    about = environment(task.env_id)
    facts = about.privileged_facts(task)
    templates = Environment(
        loader=FileSystemLoader(about.folder),
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
    """The points to drive to from each start of a verification with this seed."""
    starts = (task.start, *spread_starts(task, seed, JITTERS))
    find = environment(task.env_id).reference_path
    return [find(task, start.x, start.y) for start in starts]
