"""The world and the good controllers of the e-puck's mutation score."""

from __future__ import annotations

from pathlib import Path

from benchmarks.mutants import Original, originals_in
from tdac_agent import load_task
from tdac_agent.environments.epuck.builtin import EPuckParameters, template_for
from tdac_agent.environments.epuck.entry import EPUCK
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.task_file import TaskFile
from tdac_envs.epuck.task import EPuckTask

ZOO = Path(__file__).parent.parent / "tests" / "agent" / "zoo" / "epuck"


def small_world() -> Task:
    """A turned and shifted arena with two walls that the robot must drive around.

    The route has headings around pi, and the robot first faces away from its goal.
    """
    world = str(ZOO / "world.wbt")
    return load_task(
        TaskFile(env=EPUCK.id, world=world, name="two walls", horizon=1600)
    )


def good_drivers(task: Task) -> list[Original]:
    """The template with two sets of parameters, and the zoo's good controllers."""
    assert isinstance(task.nominal, EPuckTask)
    tuned = EPuckParameters(inflation_margin=0.01, slow_dist=0.03, unstick_after=120.0)
    texts = {
        "builtin": template_for(task.nominal).render(EPuckParameters()),
        "builtin_tuned": template_for(task.nominal).render(tuned),
    }
    built = [Original(name, "paper", text, "epuck") for name, text in texts.items()]
    return [*built, *originals_in(ZOO / "good", "epuck")]
