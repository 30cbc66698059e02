"""Promises of the hash of what decides the episodes of a task."""

import pytest

from tdac_agent.tasks.registry import own_environments
from tdac_agent.tasks.task import read_task
from tdac_envs.core.dynamics import files_of


@pytest.mark.parametrize(
    ("name", "decides"),
    [
        ("maze", {"map2d/kernels.py", "map2d/rays.py", "map2d/reception.py"}),
        ("epuck", {"worlds/world.py", "epuck/kernels.py", "epuck/infrared.py"}),
    ],
)
def test_the_code_of_the_robot_counts(name, decides):
    """Also constants such as the axle of the e-puck, which is no value of a task."""
    task = read_task(name)
    assert decides <= set(files_of(*task.environment.code))
    assert task.dynamics() == read_task(name).dynamics() != task.sha256()
    assert read_task("office").dynamics() != read_task("maze").dynamics()


def test_each_environment_names_its_own_code():
    """A change of one robot does not concern results of the other."""
    codes = [set(files_of(*each.code)) for each in own_environments()]
    assert all(one - other for one in codes for other in codes if one is not other)
