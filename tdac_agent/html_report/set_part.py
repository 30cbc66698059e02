"""What the page shows of a run on a task set: its selection, and failures in worlds."""

from __future__ import annotations

import itertools
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tdac_agent.html_report.scene import data_address
from tdac_agent.runs.history import RunHistory
from tdac_agent.runs.ownership import remark_on
from tdac_agent.runs.run_record import candidate_at
from tdac_agent.runs.selection_record import (
    HiddenCounts,
    Selection,
    read_hidden,
    read_selection,
)
from tdac_agent.runs.world_pictures import world_pictures
from tdac_agent.tasks.task_file import SET_FILE
from tdac_agent.verification.judge.episode_row import EpisodeRow
from tdac_agent.verification.store import read_report
from tdac_envs.core.errors import TdacError
from tdac_envs.ladder.task_sets import TaskSet, load_set

MOST_DRAWN = 6
SIDE = 640
"""Most width and height of a picture, px."""
PURPOSES = {
    "feedback": "feedback world",
    "validation": "validation world",
    "improve": "pool world",
    "comparison": "world of the comparison",
}
"""Names of worlds by what a candidate drove there for, in this order."""
_Driven = tuple[Path, list[tuple[str, EpisodeRow]]]


@dataclass(frozen=True, slots=True)
class DrawnFailure:
    """A failed episode of the selected controller.

    Attributes:
        name: Its world, such as `feedback world 3`.
        cause: Its cause.
        picture: A picture as a data URL.
    """

    name: str
    cause: str
    picture: str


@dataclass(frozen=True, slots=True)
class SetPart:
    """What is shown of a finished run on a task set.

    Attributes:
        selection: The candidates and the selected one.
        hidden: Its counts on hidden worlds, if it drove there.
        driven: Number of recorded episodes of the selected controller on `dev`.
        failed: Number of these that failed.
        drawn: Pictures of the first ones that failed.
        problem: Why there are no more pictures, if something broke.
    """

    selection: Selection
    hidden: HiddenCounts | None
    driven: int
    failed: int
    drawn: tuple[DrawnFailure, ...]
    problem: str


def set_part_of(history: RunHistory) -> SetPart | None:
    """Collects what is shown of a run; None before something is selected."""
    run = history.run
    selection = read_selection(run.folder) if run.on_set else None
    if selection is None:
        return None
    driven = list(_driven(run.folder / candidate_at(selection.k, selection.j)))
    episodes = [each for _, named in driven for _, each in named]
    failed = sum(not each.success for each in episodes)
    drawn, problem = list[DrawnFailure](), ""
    try:
        remark = remark_on(run) if failed else ""
        if failed and not remark:
            tasks = load_set(run.folder / SET_FILE)
            drawn += itertools.islice(_drawn(tasks, driven), MOST_DRAWN)
        elif failed:
            problem = remark.replace(str(run.folder), "the folder", 1)
    except (TdacError, OSError, ValueError) as error:
        problem = str(error)
    hidden = read_hidden(run.folder)
    return SetPart(selection, hidden, len(episodes), failed, tuple(drawn), problem)


def _driven(candidate: Path) -> Iterator[_Driven]:
    """Yields the folders of a candidate's tests, and their named episodes."""
    counts = Counter[str]()
    for purpose, name in PURPOSES.items():
        for folder in sorted(candidate.glob(f"{purpose}-*"), key=_number):
            named = []
            for episode in _episodes(folder):
                counts[purpose] += 1
                named.append((f"{name} {counts[purpose]}", episode))
            yield folder, named


def _number(folder: Path) -> int:
    digits = re.search(r"\d+$", folder.name)
    return int(digits.group()) if digits else 0


def _episodes(folder: Path) -> tuple[EpisodeRow, ...]:
    """The episodes of a report; none if it cannot be read."""
    report = read_report(folder)
    return () if report is None else report.episodes


def _drawn(tasks: TaskSet, driven: list[_Driven]) -> Iterator[DrawnFailure]:
    """Yields the failures in order, drawn."""
    for folder, named in driven:
        causes = {name: str(each.cause or each.outcome) for name, each in named}
        place = folder / "trajectories"
        for name, picture in world_pictures(tasks, named, place, SIDE):
            address = data_address(picture, "image/png")
            yield DrawnFailure(name, causes[name], address)
