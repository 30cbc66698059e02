"""Draws the moving pictures of README and site.

    python -m tools.moving_pictures docs

`repair.gif` shows the run of `tdac demo`, recorded answers of a language model: what
its first controller does, what the model says of the failure, lines of its repair, and
the repaired drive. The others show an episode in each environment.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import textwrap
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from tdac_agent import load_task, synthesize
from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.html_report.code import count_changes
from tdac_agent.html_report.story import told_of
from tdac_agent.runs.history import RunHistory, gather_run
from tdac_envs.drawing.canvas import INK, PAPER, Colour, Image, blank, write_text
from tdac_envs.drawing.runs import Status
from tdac_envs.drawing.video import write_video
from tdac_envs.map2d.picture import MapScene
from tools.run import tdac

WIDTH, FPS, SPEED = 600, 12, 7.0
"""Width of a picture, px; frames a second; simulated seconds a second."""
HOLD = 3.0
"""Seconds for which a text is shown at the end of an episode."""
SHOWN = 12.0
"""Simulated seconds of a drive that fails."""
LINE, ROWS = 22, 2
SAID = "The turning sign was wrong and could never be corrected."
"""What the model says of the failure, in its answer."""
REPAIR = (
    "-    S.W = 2.0 * C.vmax / C.base",
    "+    S.W = C.sign * 2.0 * C.vmax / C.base",
    "+                if S.vote * C.sign < -2.0:",
    "+                    C.sign = -C.sign",
)
"""Lines of its repair that tell what it is about."""
ADDED, REMOVED = (0, 110, 80), (180, 50, 30)


def repair(out: Path) -> None:
    """Draws `repair.gif`."""
    with tempfile.TemporaryDirectory() as name:
        run = Path(name) / "run"
        tdac("demo", "--out", str(run))
        told = gather_run(run)
        answer = (told.tried[1].folder / "edit.reply.md").read_text(encoding="utf-8")
        assert SAID in answer
        write_video(_frames(told), out / "repair.gif", FPS)


def _frames(told: RunHistory) -> Iterator[Image]:
    first, second = told.tried
    assert first.report is not None
    assert second.report is not None
    assert told.task is not None
    dt = told.task.nominal.dt
    fails = _episode(
        told,
        dict(first.trajectories())["nominal"],
        "A language model wrote version 1. The question did not say which wheel "
        "turns the robot left.",
        f"Version 1. {told_of(first.report, dt)}",
        SHOWN,
    )
    for frame in fails:
        yield frame
    changed = _repair_picture(second.diff or "", frame)
    yield from [changed] * round(2 * HOLD * FPS)
    yield from _episode(
        told,
        dict(second.trajectories())["nominal"],
        "Version 2 drives.",
        f"Version 2. {told_of(second.report, dt)}",
    )


def _repair_picture(diff: str, frame: Image) -> Image:
    """What the model says, and the lines that it changed, as large as another one."""
    lines = diff.splitlines()
    assert all(line in lines for line in REPAIR), "the repair is another one"
    added, removed = count_changes(diff)
    picture = blank(*frame.shape[:2], PAPER)
    texts: list[tuple[str, Colour]] = [
        (line, INK)
        for line in [
            "The model is told where and why. It answers:",
            *textwrap.wrap(f'"{SAID}"', 66),
            "",
            f"It adds {added} lines and removes {removed}, among them:",
            "",
        ]
    ]
    texts += [(line, ADDED if line[0] == "+" else REMOVED) for line in REPAIR]
    step = round(1.4 * LINE)
    top = (picture.shape[0] - step * len(texts)) // 2 + step
    for row, (line, colour) in enumerate(texts):
        write_text(picture, 60, top + step * row, line, colour)
    return picture


def _episode(
    told: RunHistory,
    trajectory: Trajectory,
    before: str,
    after: str,
    seconds: float = math.inf,
) -> Iterator[Image]:
    """An episode with a text below it, and another one at its end.

    Args:
        told: The run.
        trajectory: The episode.
        before: The text while it drives.
        after: The text at the end.
        seconds: Simulated seconds after which the picture ends.
    """
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
    steps = [n for n in trajectory.every(stride) if n * trajectory.dt <= seconds]
    for step in steps:
        status = Status(step, nominal.horizon, float(ends[step]), "")
        trail = trajectory.poses[: step + 1, :2]
        pose = trajectory.poses[step].tolist()
        frame = scene.frame(pose, trajectory.ranges[step], trail, status, [])
        last = step == steps[-1]
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
