"""Policies on another physics: the same worlds, starts and verdicts of easy drives."""

import json

import numpy as np
import pytest

from tdac_agent.evaluation.evaluate import evaluate
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.env import make
from tdac_envs.ladder.task_sets import load_set

pytest.importorskip("mujoco")


def endings(found):
    return [(each.number, each.outcome) for each in found.results[0].episodes]


@pytest.mark.slow
def test_a_set_is_driven_in_its_own_worlds(few, solver, tmp_path, warm):
    """The scene follows the world: a controller arrives in both physics."""
    file = tmp_path / "solver.py"
    file.write_text(solver)
    here, there = (
        evaluate([file], [few], 2, split="dev", physics=name, judge=warm)
        for name in ("exact", "mujoco")
    )
    assert endings(here) == endings(there) == [(n, "reached") for n in range(2)]
    steps = [[each.steps for each in f.results[0].episodes] for f in (here, there)]
    assert steps[0] != steps[1]
    assert np.allclose(*steps, atol=3)
    assert json.loads(there.model_dump_json())["physics"] == "mujoco"


def test_a_wall_is_a_contact_in_every_world(few):
    """Straight ahead, each robot ends at the wall of its own world."""
    exact, other = (
        make("unknown", split="dev", physics=p) for p in ("exact", "mujoco")
    )
    for index in range(2):
        ends = []
        for env in (exact, other):
            env.reset(options={"index": index})
            over = False
            while not over:
                _, _, ended, late, _ = env.step(np.ones(2, np.float32))
                over = ended or late
            ends.append(env.pose()[:2])
        # Where they touch, they differ by less than a step.
        assert np.abs(ends[0] - ends[1]).max() < exact.task.full_step


@pytest.mark.parametrize(
    ("level", "physics", "told"),
    [
        ("unknown", "mujoko", "unknown physics 'mujoko'"),
        ("moving", "mujoco", "has no movers"),
    ],
)
def test_what_cannot_be_driven_is_refused_first(level, physics, told):
    with pytest.raises(TaskError, match=told):
        evaluate(["go-to-goal"], [load_set(level)], 1, physics=physics)
