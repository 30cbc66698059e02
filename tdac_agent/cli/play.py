"""`tdac play`: shows one episode in a window or writes it as a video."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from tdac_agent.cli.console import Console
from tdac_agent.cli.controller_choice import (
    change_note,
    controller_and_task,
    controller_file,
    with_own_set,
)
from tdac_agent.cli.display import has_display
from tdac_agent.cli.falsify import part_of, pictures_of
from tdac_agent.cli.film import film_of
from tdac_agent.cli.play_flags import PlayOptions
from tdac_agent.cli.printed import show_printed
from tdac_agent.cli.shared_options import NoiseFlags
from tdac_agent.cli.task_choice import check_scope, check_tier
from tdac_agent.cli.task_flags import TaskFlags
from tdac_agent.cli.typed_options import require_flag
from tdac_agent.environments.epuck.pictures import WorldPictures
from tdac_agent.environments.map2d.pictures import MapPictures
from tdac_agent.episodes.trajectory import Rollout
from tdac_agent.evaluation.policies import Entrant, entrant_of, fitted
from tdac_agent.evaluation.replay import check_shown, drive_episode
from tdac_agent.option_fields import typed_fields
from tdac_agent.problems.episodes import episodes_of
from tdac_agent.problems.part import Part
from tdac_agent.ros2.bag import check_bag, write_bag
from tdac_agent.storage.plain import one_line
from tdac_agent.tasks.deviation import deviation_of
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.installation import seed_of
from tdac_agent.tasks.task import Task, write_workdir
from tdac_agent.verification.judge.episode_job import Driven
from tdac_agent.verification.judge.judge import Judge
from tdac_agent.verification.judge.policy_spec import PolicySpec
from tdac_agent.verification.suite.starts import JITTERS
from tdac_agent.verification.verify import read_source
from tdac_envs.core.errors import TaskError
from tdac_envs.drawing.canvas import Image
from tdac_envs.drawing.video import write_video
from tdac_envs.drawing.window import Window
from tdac_envs.ladder.task_sets import AnyTask, load_set
from tdac_envs.map2d.task import Map2DTask

SUFFIXES = (".mp4", ".gif")


def run(flags: TaskFlags, options: PlayOptions, noise: NoiseFlags) -> int:
    """Plays one episode; returns 0 if the goal was reached, else 1."""
    check_tier(options.tier)
    flags = with_own_set(options.controller, flags)
    if options.seed is None and flags.set_name is None:
        require_flag("--seed N", typed_fields(noise))
    elif options.seed is not None and options.episode is not None:
        raise TaskError("give --episode or --seed, not both")
    name = _checked(options.episode)
    check_scope(flags.set_name is not None, flags, options, noise)
    if flags.set_name is not None:
        return _play_world(flags.set_name, options, noise)
    controller_file(options.controller)  # fails early on a wrong name
    if options.mcap is None or options.video is not None:
        check_video(options.video)
    file, task = controller_and_task(options.controller, flags)
    if options.mcap is not None:
        check_bag(task, options.mcap)
    if note := change_note(options.controller, flags):
        print(note)
    source = read_source(file)
    if options.deviation is not None:
        return _play_deviated(task, source, options)
    solid = solid_picture(task.nominal) if options.view == "3d" else None
    if options.seed is None:
        rollout = drive(task, source, name, options.tier)
    else:
        setup = options.seed, noise.disturbance(task), options.tier
        rollout = drive_disturbed(task, source, *setup).rollout
    if options.mcap is not None:
        write_bag(options.mcap, task, rollout)
        print(f"wrote {options.mcap}")
        if options.video is None:
            return _tell(rollout)
    frames_of = partial(task.pictures().frames, rollout)
    if solid is not None:
        frames_of = partial(solid_frames, solid, rollout)
    return show(rollout, frames_of, task.name, options)


def _play_deviated(task: Task, source: bytes, options: PlayOptions) -> int:
    """Plays an episode of `tdac falsify`; returns as `run` does."""
    assert options.deviation is not None
    deviation = deviation_of(options.deviation)
    pictures = pictures_of(task, deviation, None, 0)  # fails early
    solid = solid_picture(pictures.nominal) if options.view == "3d" else None
    entrant = Entrant("", PolicySpec("controller"), source=source)
    part = part_of(task, options.seed or 0, None)
    rollout = drive_episode(entrant, task, part, options.tier, deviation).rollout
    frames_of = partial(pictures.frames, rollout)
    if solid is not None:
        frames_of = partial(solid_frames, solid, rollout)
    return show(rollout, frames_of, task.name, options)


def _play_world(name: str, options: PlayOptions, noise: NoiseFlags) -> int:
    """Plays an episode on a world of a task set; returns as `run` does."""
    check_shown(options.split)
    check_video(options.video)
    tasks, split, index = noise.on_set(load_set(name)), options.split, options.index
    episodes_of(tasks).compile()
    entrant = fitted(entrant_of(options.controller, ours=()), tasks)
    task = tasks.task(split, index)
    solid = solid_picture(task) if options.view == "3d" else None
    part = Part((index,), split)
    deviation = None
    if options.deviation is not None:
        deviation = deviation_of(options.deviation)
    rollout = drive_episode(entrant, tasks, part, options.tier, deviation).rollout
    title = f"{tasks.name}, {split} {index}"
    frames_of = partial(_frames, task, rollout)
    if solid is not None:
        frames_of = partial(solid_frames, solid, rollout)
    return show(rollout, frames_of, title, options)


def _frames(task: AnyTask, rollout: Rollout, stride: int) -> Iterator[Image]:
    if isinstance(task, Map2DTask):
        return MapPictures(task).frames(rollout, stride)
    return WorldPictures(task).frames(rollout, stride)


def solid_picture(task: Any) -> Any:
    """What draws episodes of a task in three dimensions.

    Raises:
        TaskError: MuJoCo is not installed, or cannot render here or this task.
    """
    if isinstance(task, Map2DTask):
        from tdac_envs.map2d.solid_picture import SolidPicture as OnMap

        return OnMap(task)
    from tdac_envs.epuck.solid_picture import SolidPicture as InWorld

    return InWorld(task)


def solid_frames(solid: Any, rollout: Rollout, stride: int) -> Iterator[Image]:
    """Draws the robot in every `stride`-th step and the last one."""
    trajectory = rollout.trajectory
    for step in trajectory.every(stride):
        movers = trajectory.movers
        yield solid.frame(
            trajectory.poses[step].tolist(),
            trajectory.poses[:step, :2].tolist(),
            discs=None if movers is None else movers[step].astype(float),
        )


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
    options: PlayOptions,
) -> int:
    """Writes an episode as a video, or shows it in a window; prints how it ended.

    Args:
        rollout: The episode.
        frames_of: Draws every n-th step.
        title: Name of the task.
        options: File and speed of the video.

    Returns:
        0 if the goal was reached, else 1.
    """
    steps, dt = rollout.trajectory.steps, rollout.trajectory.dt
    video, speed = options.video, options.speed
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
    return _tell(rollout)


def _tell(rollout: Rollout) -> int:
    """Prints what the controller printed and how the episode ended."""
    steps = rollout.trajectory.steps
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
    entrant = Entrant("", PolicySpec("controller"), source=source)
    return drive_episode(entrant, task, Part((seed,), disturbance=disturbance), tier)


def _checked(episode: str | None) -> str:
    names = ["nominal", *(f"jitter {number}" for number in range(1, JITTERS + 1))]
    if episode is not None and episode not in names:
        known = ", ".join(names)
        raise TaskError(f"unknown --episode {episode!r}; expected one of {known}")
    return episode or "nominal"


def _because(rollout: Rollout) -> str:
    return f": {one_line(rollout.error)}" if rollout.error else ""
