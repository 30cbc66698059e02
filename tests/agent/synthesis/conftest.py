"""A task and a set to write controllers for, and runs with scripted models."""

import pytest
from script import Script
from subject import Subject
from unconfirmed import synthesize

from tdac_agent.models.retry import RetryPolicy

ON_SET = {"search": "paper", "episodes": 12, "feedback_episodes": 2, "seed": 3}


@pytest.fixture(scope="session")
def task(policy_task):
    return policy_task


@pytest.fixture
def on_task(task, good_source):
    return Subject(task, good_source)


@pytest.fixture
def on_set(few, solver):
    return Subject(few, solver, ON_SET)


@pytest.fixture(params=["on_task", "on_set"])
def ground(request):
    """A task, and a set of worlds."""
    return request.getfixturevalue(request.param)


@pytest.fixture
def write(out, warm):
    """Runs with prepared answers; returns the model and the run."""

    def run(ground, *answers, model=None, **values):
        model = model or Script(*answers)
        given = {"out": out, "judge": warm, "retry": RetryPolicy(first_wait=0.0)}
        return model, synthesize(ground.problem, model, **given | ground.given | values)

    return run


@pytest.fixture
def improve(write):
    """Runs that improve what works, with few episodes."""

    def run(ground, model="builtin", **values):
        few = {"seed": 3, "iterations": 6} if ground.is_task else {"episodes": 4}
        return write(ground, model=model, **{"improve": 32} | few | values)[1]

    return run
