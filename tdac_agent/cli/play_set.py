"""`tdac play --set`: shows an episode on a world of a task set."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from tdac_agent.cli.flags import check_tier
from tdac_agent.cli.play import check_video, show
from tdac_agent.environments.map2d.pictures import frames_of
from tdac_agent.evaluation.set_entrants import set_entrants
from tdac_agent.evaluation.set_play import check_shown, play_world
from tdac_agent.tasks.first_run import compile_first
from tdac_agent.tasks.registry import environment
from tdac_envs.ladder.task_sets import load_set
from tdac_envs.map2d.task import Map2DTask


def run(
    controller: str,
    name: str,
    split: str,
    index: int,
    video: Path | None,
    speed: float | None,
    tier: str,
) -> int:
    """Plays an episode; returns 0 if the goal was reached, else 1."""
    check_tier(tier)
    check_shown(split)
    check_video(video)
    tasks = load_set(name)
    (entrant,) = set_entrants([controller], tasks)
    compile_first(environment(Map2DTask.env_id))
    rollout, task = play_world(entrant, tasks, split, index, tier)
    title = f"{tasks.name}, {split} {index}"
    return show(rollout, partial(frames_of, task, rollout), title, video, speed)
