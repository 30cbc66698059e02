"""Draws the moving pictures of README and site.

    python -m tools.moving_pictures docs

`repair.gif` shows a run of `tdac synth --task office --from controller.py`: the given
controller plans for a point and hits a corner, and the built-in template repairs it.
The texts are those of its report. The others show an episode in each environment.
"""

from __future__ import annotations

import argparse
import tempfile
import textwrap
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from tdac_agent import load_task, synthesize
from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.html_report.story import changed_in, told_of
from tdac_agent.runs.history import CandidateHistory, RunHistory, gather_run
from tdac_envs.drawing.canvas import INK, PAPER, Image, blank, write_text
from tdac_envs.drawing.runs import Status
from tdac_envs.drawing.video import write_video
from tdac_envs.map2d.picture import MapScene
from tools import for_a_point
from tools.run import tdac

WIDTH, FPS, SPEED = 600, 12, 7.0
"""Width of a picture, px; frames a second; simulated seconds a second."""
HOLD = 3.0
"""Seconds for which a text is shown at the end of an episode."""
LINE, ROWS = 22, 2


def repair(out: Path) -> None:
    """Draws `repair.gif`."""
    with tempfile.TemporaryDirectory() as name:
        run, near = Path(name) / "run", for_a_point.write(Path(name))
        words = "--task", for_a_point.TASK, "--from", str(near), "--out", str(run)
        tdac("synth", *words)
        told = gather_run(run)
        write_video(_frames(told), out / "repair.gif", FPS)


def _frames(told: RunHistory) -> Iterator[Image]:
    for number, one in enumerate(told.tried, 1):
        trajectory = dict(one.trajectories())["nominal"]
        before, after = _captions(one, number, trajectory.dt)
        yield from _episode(told, trajectory, before, after)


def _captions(one: CandidateHistory, number: int, dt: float) -> tuple[str, str]:
    """What is written below a version that drives, and that has driven."""
    assert one.report is not None
    name = f"Version {number}"
    before = f"{name} plans its path for a point."
    if number > 1:
        before = (
            "The template is told where and why, and repairs it: "
            f"{changed_in(one)}. {name} drives."
        )
    return before, f"{name}. {told_of(one.report, {'dt': dt})}"


def _episode(
    told: RunHistory, trajectory: Trajectory, before: str, after: str
) -> Iterator[Image]:
    assert told.task is not None
    nominal = told.task.nominal
    scene = MapScene(
        nominal.terrain.grid.cells,
        trajectory.poses[0].tolist(),
        nominal.goal,
        goal_tolerance=nominal.goal_tolerance,
        robot=nominal.robot,
        path=nominal.shortest_path(nominal.start),
    )
    stride = max(1, round(SPEED / FPS / trajectory.dt))
    ends = np.hypot(*(trajectory.poses[:, :2] - nominal.goal).T)
    for step in trajectory.every(stride):
        status = Status(step, nominal.horizon, float(ends[step]), "")
        trail = trajectory.poses[: step + 1, :2]
        pose = trajectory.poses[step].tolist()
        frame = scene.frame(pose, trajectory.ranges[step], trail, status, [])
        last = step == trajectory.steps
        shown = _with_caption(frame, after if last else before)
        for _ in range(round(HOLD * FPS) if last else 1):
            yield shown


def _with_caption(frame: Image, text: str) -> Image:
    small = _scaled(frame, WIDTH)
    strip = blank(LINE * ROWS + 10, WIDTH, PAPER)
    for row, line in enumerate(textwrap.wrap(text, 70)[:ROWS]):
        write_text(strip, 10, LINE * (row + 1), line, INK)
    return np.vstack([small, strip])


def _scaled(frame: Image, width: int) -> Image:
    """A smaller frame; videos need an even number of rows."""
    height = round(frame.shape[0] * width / frame.shape[1] / 2) * 2
    return cv2.resize(frame, (width, height), interpolation=cv2.INTER_AREA)


def drive(episode: str, speed: float, file: Path, width: int = WIDTH) -> None:
    """Draws an episode with `tdac play`, smaller than it does."""
    with tempfile.TemporaryDirectory() as name:
        film = Path(name) / "film.mp4"
        tdac("play", *episode.split(), "--speed", f"{speed:g}", "--video", str(film))
        source = cv2.VideoCapture(str(film))
        fps = source.get(cv2.CAP_PROP_FPS)
        stride = max(1, round(fps / FPS))
        write_video(_thinned(source, stride, width), file, FPS)


def _thinned(source: cv2.VideoCapture, stride: int, width: int) -> Iterator[Image]:
    number = 0
    while source.grab():
        if number % stride == 0:
            frame = source.retrieve()[1]
            yield np.ascontiguousarray(_scaled(frame, width)[..., ::-1])
        number += 1


def main() -> None:
    """Draws all of them, or one."""
    parser = argparse.ArgumentParser(prog="python -m tools.moving_pictures")
    parser.add_argument("out", type=Path)
    parser.add_argument("--only", default="", help="name of one, such as map2d.gif")
    given = parser.parse_args()
    out, only = given.out, given.only
    if only in ("", "repair.gif"):
        repair(out)
    for task, file in (("maze", "map2d.gif"), ("epuck", "epuck.gif")):
        if only in ("", file):
            with tempfile.TemporaryDirectory() as name:
                folder = Path(name) / task
                synthesize(load_task(task), learner="builtin", out=folder)
                drive(str(folder), 7.0, out / file)
    if only in ("", "ladder.gif"):
        episode = "builtin --set moving --split dev --index 3"
        drive(episode, 3.0, out / "ladder.gif", 360)


if __name__ == "__main__":
    main()
