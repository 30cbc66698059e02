"""Draws the pictures of the gallery.

    python -m tools.gallery docs/gallery [NAME …]
    python -m tools.gallery --answers FOLDER

`LEVEL-KIND.png` is a drive on the first world of `test`: of `builtin`, of the first of
the recorded answers, or of the first PPO that is kept. It must end as its row in the
tables of `results/ladder/arena/test` says; `floor` has no such row. `--answers` draws
nothing and writes the answers as FOLDER/LEVEL.py.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from benchmarks.ladder_results import RESULTS
from tdac_agent.environments.epuck.pictures import WorldPictures
from tdac_agent.environments.map2d.pictures import MapPictures
from tdac_agent.episodes.trajectory import Rollout
from tdac_agent.evaluation.policies import entrant_of, fitted
from tdac_agent.evaluation.replay import drive_episode
from tdac_agent.problems.episodes import episodes_of
from tdac_agent.problems.part import Part
from tdac_agent.prompting.extract import extract_source
from tdac_envs.drawing.canvas import TRAIL
from tdac_envs.drawing.marks import draw_movers
from tdac_envs.drawing.runs import SMALLEST_BODY, draw_runs
from tdac_envs.ladder.task_sets import AnyTask, load_set
from tdac_envs.map2d.task import Map2DTask

LEVELS = "known", "unknown", "lost", "moving", "crowd", "epuck"
KINDS = {
    "program": ("our own program", "programs", "builtin"),
    "model": ("language model", "answers", "first-answers"),
    "learned": ("learned policy", "learned", "ppo"),
}
"""By the end of a picture's name: in words, folder and entrant of the record."""
NAMES = *(f"{level}-{kind}" for level in LEVELS for kind in KINDS), "floor-program"
TIMED = "model"
"""Programs that read the CPU clock: a drive can end otherwise than the recorded one."""
SPLIT, WORLD = "test", 0
WIDTH = 480
"""Width of a picture, px."""
STRONG = 5
"""Width of the line of a drive, px of the whole picture."""
FACTS = "Description"
"""Key of the text in a PNG."""


def draw(name: str, file: Path) -> None:
    """Drives an episode and writes its picture, which keeps what happened as text.

    Raises:
        SystemExit: The drive ended otherwise than the recorded one.
    """
    level, kind = name.split("-")
    tasks = load_set(level)
    episodes_of(tasks).compile()
    with tempfile.TemporaryDirectory() as folder:
        words = policy(level, kind, Path(folder))
        entrant = fitted(entrant_of(words, ours=()), tasks)
        part = Part((WORLD,), SPLIT)
        rollout = drive_episode(entrant, tasks, part, "auto", None).rollout
    found = rollout.outcome, rollout.trajectory.steps
    kept = recorded(level, kind) if level in LEVELS else None
    text = said(*found)
    if kept not in (None, found):
        if kind != TIMED:
            raise SystemExit(f"{name}: recorded are {kept}, driven were {found}")
        text += f" (recorded: {said(*kept)})"
    picture = _drive(tasks.task(SPLIT, WORLD), rollout)
    height = round(picture.shape[0] * WIDTH / picture.shape[1])
    small = cv2.resize(picture, (WIDTH, height), interpolation=cv2.INTER_AREA)
    about = PngInfo()
    about.add_text(FACTS, f"{level}, {KINDS[kind][0]}: {text}")
    # The other method loses colours that are rare.
    rare = {"method": Image.Quantize.FASTOCTREE, "dither": Image.Dither.NONE}
    Image.fromarray(small).quantize(**rare).save(file, optimize=True, pnginfo=about)


def policy(level: str, kind: str, folder: Path) -> str:
    """What drives, as an argument of `tdac play`."""
    if kind == "program":
        return "builtin"
    if kind == "learned":
        return str(RESULTS / "learned" / f"ppo-{level}-0" / "policy.zip")
    return str(write_answer(level, folder))


def write_answer(level: str, folder: Path) -> Path:
    """Writes the code of the first recorded answer; returns the file."""
    reply = RESULTS / "genuine" / level / "1" / "reply.md"
    source = extract_source(reply.read_text(encoding="utf-8"))
    assert source is not None, reply
    file = folder / f"{level}.py"
    file.write_text(source, encoding="utf-8")
    return file


def recorded(level: str, kind: str) -> tuple[str, int]:
    """Outcome and steps of the same drive in the tables of the arena."""
    _, folder, entrant = KINDS[kind]
    rows = pd.read_csv(RESULTS / "arena" / SPLIT / f"{folder}-{level}" / "worlds.csv")
    own = rows[(rows["entrant"] == entrant) & (rows["index"] == WORLD)]
    (row,) = own[own["file"] == 0].to_dict("records")
    return str(row["outcome"]), int(row["steps"])


def said(outcome: str, steps: int) -> str:
    """What happened, in words."""
    words = {"reached": "reached the goal", "collision": "hit an obstacle"}
    return f"{words.get(outcome, outcome)} after {steps:,} steps"


def _drive(task: AnyTask, rollout: Rollout) -> Any:
    """The world with the way that was driven, uint8 RGB."""
    of = MapPictures if isinstance(task, Map2DTask) else WorldPictures
    backdrop = of(task).backdrop()  # type: ignore[arg-type]
    chart = backdrop.whole()
    trajectory = rollout.trajectory
    draw_movers(chart.canvas, trajectory.ghosts(trajectory.steps))
    places = chart.at(trajectory.poses[:, :2])
    run = np.column_stack([places, trajectory.poses[:, 2]])
    chart.canvas.line(places, TRAIL, STRONG)
    body = max(backdrop.radius * chart.scale, SMALLEST_BODY)
    draw_runs(chart.canvas, [run], [rollout.outcome], body)
    return chart.canvas.image[: chart.canvas.strip_top]


def main() -> None:
    """Draws all of them, or some."""
    parser = argparse.ArgumentParser(prog="python -m tools.gallery")
    parser.add_argument("out", type=Path)
    parser.add_argument("--answers", action="store_true", help="write the answers")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(NAMES))
    given = parser.parse_args()
    if unknown := [name for name in given.names if name not in NAMES]:
        parser.error(f"no picture {unknown[0]}: {', '.join(NAMES)}")
    given.out.mkdir(parents=True, exist_ok=True)
    if given.answers:
        for level in LEVELS:
            print(write_answer(level, given.out))
        return
    for name in given.names or NAMES:
        draw(name, given.out / f"{name}.png")
        print(f"{name}.png", flush=True)


if __name__ == "__main__":
    main()
