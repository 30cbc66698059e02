"""`tdac play`: one episode in a window or a video."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tdac_agent.commands.flags import TaskFlags, check_tier
from tdac_agent.commands.verify import controller_and_task
from tdac_agent.judge import Judge
from tdac_agent.task import Task, write_workdir
from tdac_agent.trajectory import Rollout
from tdac_agent.verification import read_source
from tdac_envs.errors import TaskError
from tdac_envs.render import Scene, Status
from tdac_envs.video import write_video
from tdac_envs.window import Window

SUFFIXES = (".mp4", ".gif")
STRIDE = 2


def run(
    controller: str, flags: TaskFlags, video: Path | None, seed: int, tier: str
) -> int:
    """Plays one episode; returns 0 if the goal was reached."""
    check_tier(tier)
    if video is None and not has_display():
        raise TaskError("there is no display here: give --video FILE.mp4 (or .gif)")
    if video is not None and video.suffix not in SUFFIXES:
        raise TaskError(f"cannot write {video.name!r}: expected .mp4 or .gif")
    file, task = controller_and_task(controller, flags)
    rollout = drive(task, read_source(file), seed, tier)
    picked = frames(task, rollout)
    rate = 1.0 / (task.nominal.dt * STRIDE)
    if video is not None:
        write_video(picked, video, fps=2 * rate)
        print(f"wrote {video} (twice real time)")
    else:
        window = Window(f"tdac: {task.name}", rate)
        for frame in picked:
            window.show(frame)
        window.close()
    steps = rollout.trajectory.steps
    print(f"{rollout.outcome} after {steps} steps" + _because(rollout))
    return 0 if rollout.reached else 1


def drive(task: Task, source: bytes, seed: int, tier: str) -> Rollout:
    """One judged episode: the nominal start, or jittered start `seed`."""
    name = "nominal" if seed == 0 else f"jitter {seed}"
    with tempfile.TemporaryDirectory(prefix="tdac-play-") as folder:
        work = Path(folder)
        write_workdir(work, task)
        judge = Judge(task, source, work, tier=tier, seed=0)
        try:
            return judge.drive(name)
        finally:
            judge.close()


def frames(task: Task, rollout: Rollout) -> Iterator[NDArray[np.uint8]]:
    """A frame for every second step, and the last one."""
    nominal, trajectory = task.nominal, rollout.trajectory
    start = trajectory.poses[0]
    scene = Scene(
        nominal.terrain.grid.cells,
        start.tolist(),
        nominal.goal,
        goal_tolerance=nominal.goal_tolerance,
        robot=nominal.robot,
        path=nominal.path_from(nominal.start),
        robot_image=task.robot_image,
    )
    last = trajectory.steps
    gaps = rollout.distances("euclidean")
    for step in [*range(0, last, STRIDE), last]:
        status = Status(
            step,
            nominal.horizon,
            float(gaps[step]),
            rollout.outcome if step == last else "",
        )
        trail = trajectory.poses[: step + 1, :2]
        pose = trajectory.poses[step].tolist()
        yield scene.frame(pose, trajectory.ranges[step], trail, status)


def has_display() -> bool:
    """Whether a window can be opened."""
    if sys.platform in ("darwin", "win32"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _because(rollout: Rollout) -> str:
    return f": {rollout.error}" if rollout.error else ""
