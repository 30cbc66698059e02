"""The HTML page of a bench: tables, figures, and replays side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tdac_agent.bench.record import Bench
from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.html_report.animation import encoded, shares
from tdac_agent.html_report.page import rendered
from tdac_agent.html_report.scene import TaskPicture, data_address, picture_of
from tdac_agent.storage.files import write_atomic
from tdac_envs.core.intake import IMAGE_BYTES, read_file
from tdac_envs.ladder.picture import backdrop_of
from tdac_envs.ladder.task_sets import AnyTask

PAGE = "bench.html"
MOST_WORLDS = 6
"""Worlds of each set whose episodes the page shows."""


@dataclass(frozen=True, slots=True, eq=False)
class Replay:
    """An episode to show.

    Attributes:
        entrant: Name of the entrant.
        index: Number of the episode.
        name: Its name.
        outcome: How it ended.
        trajectory: The episode.
    """

    entrant: str
    index: int
    name: str
    outcome: str
    trajectory: Trajectory


def write_page(
    found: Bench,
    replays: Mapping[str, Sequence[Replay]],
    tasks: Mapping[str, Mapping[int, AnyTask]],
    figures: Sequence[str],
    out: Path,
) -> None:
    """Writes `bench.html`.

    Args:
        found: The bench.
        replays: Episodes of each set.
        tasks: Tasks of their worlds, by set and number.
        figures: Names of figures in `out`.
        out: Folder of the bench.
    """
    scenes: dict[str, TaskPicture] = {}
    sections = []
    for own in found.sets:
        episodes = []
        known = replays.get(own.name, ())
        most = shares([replay.trajectory for replay in known])
        for replay in known:
            key, task = f"{own.name} {replay.index}", tasks[own.name][replay.index]
            if key not in scenes:
                scenes[key] = picture_of(backdrop_of(task))
            episodes.append(_episode(replay, key, task, scenes[key], most))
        first = next(iter(episodes), None)
        sections.append(
            {
                "set": own,
                "rows": found.of_set(own.name),
                "pairs": [pair for pair in found.pairs if pair.set == own.name],
                "episodes": episodes,
                "scene": first and (first["scene"], scenes[first["scene"]]),
            }
        )
    pictures = [
        (name, data_address(read_file(out / name, IMAGE_BYTES), "image/svg+xml"))
        for name in figures
    ]
    values = {"bench": found, "sections": sections, "figures": pictures}
    html = rendered("bench.html.j2", scenes, name=out.resolve().name, **values)
    write_atomic(out / PAGE, html)


def _episode(
    replay: Replay,
    key: str,
    task: AnyTask,
    scene: TaskPicture,
    most: tuple[int, int],
) -> dict[str, Any]:
    return {
        "candidate": replay.entrant,
        "label": replay.entrant,
        "name": replay.name,
        "scene": key,
        **encoded(task, scene, replay.trajectory, replay.outcome, most),
    }
