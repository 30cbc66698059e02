"""`tdac play`: shows one episode in a window or writes it as a video."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from tdac_agent.cli.console import Console
from tdac_agent.cli.display import has_display
from tdac_agent.cli.film import film_of
from tdac_agent.cli.flags import TaskFlags, check_tier
from tdac_agent.cli.printed import show_printed
from tdac_agent.cli.robust_flags import DisturbanceFlags, require_flag
from tdac_agent.cli.verify import controller_and_task
from tdac_agent.episodes.trajectory import Rollout
from tdac_agent.evaluation.policies import Entrant
from tdac_agent.evaluation.replay import drive_episode
from tdac_agent.problems.episodes import Part
from tdac_agent.storage.plain import one_line
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.installation import seed_of
from tdac_agent.tasks.task import Task, write_workdir
from tdac_agent.verification.judge.drivers import PolicySpec
from tdac_agent.verification.judge.episode_job import Driven
from tdac_agent.verification.judge.judge import Judge
from tdac_agent.verification.suite.starts import JITTERS
from tdac_agent.verification.verify import read_source
from tdac_envs.core.errors import TaskError
from tdac_envs.drawing.canvas import Image
from tdac_envs.drawing.video import write_video
from tdac_envs.drawing.window import Window

SUFFIXES = (".mp4", ".gif")


def run(
    controller: str,
    flags: TaskFlags,
    video: Path | None,
    speed: float | None,
    episode: str | None,
    seed: int | None,
    disturbed: DisturbanceFlags,
    tier: str,
) -> int:
    """Plays one episode; returns 0 if the goal was reached, else 1."""
    check_tier(tier)
    if seed is None:
        require_flag("--seed N", list(disturbed.given()))
    elif episode is not None:
        raise TaskError("give --episode or --seed, not both")
    name, disturbance = _checked(episode), disturbed.disturbance()
    check_video(video)
    file, task = controller_and_task(controller, flags)
    if seed is None:
        rollout = drive(task, read_source(file), name, tier)
    else:
        task.disturbed_options(disturbance)
        driven = drive_disturbed(task, read_source(file), seed, disturbance, tier)
        rollout = driven.rollout
    pictures = task.pictures()
    return show(rollout, partial(pictures.frames, rollout), task.name, video, speed)


def check_video(video: Path | None) -> None:
    """Checks before the work begins that an episode can be shown.

    Raises:
        TaskError: It cannot.
    """
    if video is None and not has_display():
        raise TaskError("there is no display: give --video FILE.mp4 (or .gif)")
    if video is not None and video.suffix not in SUFFIXES:
        raise TaskError(f"--video must end in .mp4 or .gif, got {video.name!r}")


def show(
    rollout: Rollout,
    frames_of: Callable[[int], Iterator[Image]],
    title: str,
    video: Path | None,
    speed: float | None,
) -> int:
    """Writes an episode as a video, or shows it in a window; prints how it ended.

    Args:
        rollout: The episode.
        frames_of: Draws every n-th step.
        title: Name of the task.
        video: File of the video; None for a window.
        speed: Simulated time / playing time, if given.

    Returns:
        0 if the goal was reached, else 1.
    """
    steps, dt = rollout.trajectory.steps, rollout.trajectory.dt
    # A window can be closed at any time: it shows real time, however long it lasts.
    speed = 1.0 if video is None and speed is None else speed
    film = film_of(steps, dt, speed, video)
    frames = frames_of(film.stride)
    if video is not None:
        write_video(frames, video, film.fps)
        print(f"wrote {video} ({film})")
    else:
        window = Window(f"tdac: {title}", film.fps)
        for frame in frames:
            window.show(frame)
        window.close()
    show_printed(rollout.printed, Console())
    print(f"{rollout.name}: {rollout.outcome} after {steps} steps" + _because(rollout))
    return 0 if rollout.reached else 1


def drive(task: Task, source: bytes, name: str, tier: str) -> Rollout:
    """Runs one judged episode of the suite, by its name in the report."""
    with tempfile.TemporaryDirectory(prefix="tdac-play-") as folder:
        work = Path(folder)
        write_workdir(work, task)
        seed = seed_of(source, task)
        judge = Judge(task, source, work, tier=tier, seed=seed, at_a_time=1)
        try:
            return judge.drive(name)
        finally:
            judge.close()


def drive_disturbed(
    task: Task, source: bytes, seed: int, disturbance: Disturbance, tier: str
) -> Driven:
    """Runs the judged episode of a seed, as in a robust verification."""
    with tempfile.TemporaryDirectory(prefix="tdac-play-") as folder:
        file = Path(folder) / "controller.py"
        file.write_bytes(source)
        entrant = Entrant(file.name, PolicySpec("controller", file))
        part = Part((seed,), disturbance=disturbance)
        return drive_episode(entrant, task, part, tier)


def _checked(episode: str | None) -> str:
    names = ["nominal", *(f"jitter {number}" for number in range(1, JITTERS + 1))]
    if episode is not None and episode not in names:
        known = ", ".join(names)
        raise TaskError(f"unknown --episode {episode!r}; expected one of {known}")
    return episode or "nominal"


def _because(rollout: Rollout) -> str:
    return f": {one_line(rollout.error)}" if rollout.error else ""
