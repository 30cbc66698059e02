"""How long a controller needs for its answers, compared with the node's budget."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path

from tdac_agent.environments.map2d.setting import map_setting
from tdac_agent.evaluation.policy import Policy
from tdac_agent.ros2.package.settings import SHARE
from tdac_agent.runs.ownership import load_task
from tdac_agent.sandbox import ControllerFault
from tdac_agent.storage.files import read_inside
from tdac_agent.tasks.task import Task
from tdac_envs.core.intake import RECORD_BYTES
from tdac_envs.map2d.env import Map2DEnv

MOST = 300
"""Answers that are timed."""
SPARED = 60.0
"""Longest time of the drive, s."""


@dataclass(frozen=True, slots=True)
class Answers:
    """How long a controller needed on this machine, in its sandbox.

    Attributes:
        count: Answers after the first one, which may include planning.
        late: How many needed more than the budget.
        longest: The longest of them, s.
        budget: The time in which the node needs an answer, s.
    """

    count: int
    late: int
    longest: float
    budget: float

    def warning(self) -> str:
        """A line if answers were late; else an empty text."""
        if not self.late:
            return ""
        return (
            f"{self.late} of {self.count} answers took longer than {self.budget:g} s "
            f"here, the longest {self.longest:.2f} s: the node stops the robot "
            "meanwhile, and for good if most are late"
        )


def time_answers(run_folder: Path) -> Answers:
    """Drives the controller of a run from its start, and times its answers."""
    task = load_task(run_folder)
    source = read_inside(run_folder, "controller.py", RECORD_BYTES)
    return timed(source, task)


def timed(source: bytes, task: Task, tier: str = "auto") -> Answers:
    """The same for a controller and its task.

    Args:
        source: The controller.
        task: Its task, in metres.
        tier: Sandbox tier.
    """
    setting = map_setting(task.setting)
    budget = SHARE * setting.nominal.dt
    seconds: list[float] = []
    env = setting.make_env()
    env = Map2DEnv.of(replace(env.setup, metric=setting.task_units.frame))
    observation, _ = env.reset(seed=0)
    over, end = False, time.monotonic() + SPARED
    with Policy(source, task, tier) as policy:
        while not over and len(seconds) <= MOST and time.monotonic() < end:
            began = time.monotonic()
            try:
                action = policy(observation)
            except (ControllerFault, ValueError):
                break
            seconds.append(time.monotonic() - began)
            observation, _, terminated, truncated, _ = env.step(action)
            over = terminated or truncated
    later = seconds[1:]
    late = sum(each > budget for each in later)
    return Answers(len(later), late, max(later, default=0.0), budget)
