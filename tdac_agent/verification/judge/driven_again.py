"""Drives the episodes that reached the goal again, with another physics."""

from __future__ import annotations

from contextlib import closing

from tdac_agent.episodes.trajectory import Rollout
from tdac_agent.tasks.task import Task
from tdac_agent.verification.diagnosis.nearest import gap_of
from tdac_agent.verification.diagnosis.report import OtherEpisode, SecondOpinion
from tdac_agent.verification.judge.findings import driven
from tdac_agent.verification.judge.judge import Judge
from tdac_envs.physics.engine import engine_version
from tdac_envs.physics.moved import MEASURED, VARIED


def drive_again(judge: Judge, physics: str) -> SecondOpinion | None:
    """The second opinion of another physics; None if no episode reached the goal.

    Starts, seeds and controller are the same; each episode has a fresh process. The
    limits of CPU and wall time hold anew.

    Args:
        judge: The judge of the suite, after its tests.
        physics: Name of the other physics.
    """
    task = judge.task
    assert isinstance(task, Task)
    before = {each.name: each for each in driven(judge) if each.reached}
    if "nominal" not in before:
        return None
    with closing(judge.twin(physics)) as twin:
        twin.begin(jitters=len(before) > 1, own_loop=False)
        again = [twin.rollout(name) for name in before]
    if twin.fault is not None:
        judge.fault = judge.fault or twin.fault
    return SecondOpinion(
        engine=engine_version(),
        scaled=not task.setting.has_metres,
        varied=physics == VARIED,
        measured=physics == MEASURED,
        episodes=tuple(_row(task, each, before[each.name]) for each in again),
    )


def _row(task: Task, there: Rollout, here: Rollout) -> OtherEpisode:
    gaps = [gap_of(each, task.nominal) for each in (there, here)]
    there_gap, here_gap = (None if gap is None else gap.gap for gap in gaps)
    return OtherEpisode(
        name=there.name,
        outcome=there.outcome,
        steps=there.trajectory.steps,
        gap=there_gap,
        exact_gap=here_gap,
    )
