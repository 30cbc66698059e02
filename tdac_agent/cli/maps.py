"""`tdac map`: preprocesses a map image and shows the candidates."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.table import Table

from tdac_agent.cli.console import Console
from tdac_agent.cli.flags import check_finite, check_radius, in_pixels
from tdac_envs.core.errors import PolarityError, TaskError
from tdac_envs.mapping.bundled import bundled_map, bundled_maps
from tdac_envs.mapping.candidates import Candidate, Preset
from tdac_envs.mapping.image import load_image
from tdac_envs.mapping.map_folder import write_map
from tdac_envs.mapping.params import MapParams, ReadingOptions, RobotParams
from tdac_envs.mapping.preprocessing import preprocess_with_candidates

SHOWN, EXPLAINED = 8, 2
Point = tuple[float, float]


def run(
    image: str,
    start: Point | None,
    goal: Point | None,
    robot_radius: float | None,
    snap: bool,
    metres: bool,
    said: ReadingOptions,
    preset: Preset,
    out: Path | None,
    as_json: bool,
) -> None:
    """Preprocesses a map, writes its folder and prints the best candidates."""
    if (start is None) != (goal is None):
        raise TaskError("give both --start X Y and --goal X Y, or neither")
    check_finite(start=start, goal=goal)
    path, heading = Path(image), 0.0
    if image in bundled_maps():
        bundled = bundled_map(image)
        heading = bundled.heading
        path, start, goal = bundled.image, start or bundled.start, goal or bundled.goal
        robot_radius = robot_radius or bundled.robot_radius
    if metres:
        start, goal, robot_radius = in_pixels(path, start, goal, robot_radius)
    check_radius(robot_radius)
    radius = RobotParams().radius if robot_radius is None else robot_radius
    source = load_image(path)
    folder = out if out is not None else Path(f"{path.stem}-map")
    how: Any = {"preset": preset, "snap": snap, "heading": heading, "said": said}
    try:
        grid, params, ranked = preprocess_with_candidates(
            source, start, goal, radius, **how
        )
    except PolarityError as error:
        error.folder = folder
        raise
    files = write_map(folder, grid, params, source)
    if as_json:
        rows = [_row(candidate) for candidate in ranked]
        record = {
            "params": params.model_dump(mode="json"),
            "candidates": rows,
            "files": [str(file) for file in files],
        }
        sys.stdout.write(json.dumps(record, indent=2) + "\n")
        return
    console = Console(highlight=False)
    _print_reading(console, params, ranked[0])
    if start is not None:  # candidates have figures only if there is a task
        _print_candidates(console, ranked)
    _print_files(console, params, folder)


def _row(candidate: Candidate) -> dict[str, object]:
    reading, terms = candidate.reading, candidate.terms
    return {
        "polarity": reading.polarity,
        "method": reading.method,
        "cleanup": reading.cleanup,
        "opening": reading.opening,
        "inflation": candidate.inflation,
        "score": None if terms is None else candidate.score,
        "terms": None if terms is None else terms.model_dump(),
        "failure": candidate.failure,
    }


def _print_reading(console: Console, params: MapParams, chosen: Candidate) -> None:
    """Prints the map's name and size, how it was read, and the notes."""
    size = f"{params.width} x {params.height} px"
    console.print(f"{escape(params.source)}, {size}: {escape(_describe(chosen))}")
    for note in params.notes:
        console.print(f"[yellow]note:[/] {escape(note)}")


def _print_candidates(console: Console, ranked: list[Candidate]) -> None:
    """Prints the best candidates, and why others are infeasible."""
    feasible = [c for c in ranked if c.terms is not None]
    readings = list(dict.fromkeys(_describe(c) for c in feasible[:SHOWN]))
    console.print(_table(feasible[:SHOWN], readings))
    for number, reading in enumerate(readings, 1):
        if len(readings) > 1:
            console.print(f"reading {number}: {escape(reading)}")
    failed = [c for c in ranked if c.terms is None]
    if failed:
        console.print("[dim]Not chosen, since the robot could not drive there:[/]")
    for candidate in failed[:EXPLAINED]:
        text = _describe(candidate)
        if candidate.inflation:
            text += f", margin {candidate.inflation} px"
        failure = escape(candidate.failure or "")
        console.print(f"[dim]  {escape(text)}: {failure}[/]")
    hidden = max(len(feasible) - SHOWN, 0) + max(len(failed) - EXPLAINED, 0)
    if hidden:
        more = "1 more candidate" if hidden == 1 else f"{hidden} more candidates"
        console.print(f"and {more} (--json lists all)")


def _table(candidates: list[Candidate], readings: list[str]) -> Table:
    """The figures of feasible candidates, with their reading if there are several."""
    table = Table(title="Candidates, the chosen one first", title_justify="left")
    names = ["margin, px", "clearance, px", "path, px", "sharpness", "score"]
    for name in names if len(readings) == 1 else ["reading", *names]:
        table.add_column(name, justify="right", no_wrap=True)
    for place, candidate in enumerate(candidates):
        assert candidate.terms is not None
        figures = [
            str(candidate.inflation),
            f"{candidate.terms.min_clearance:.1f}",
            f"{candidate.terms.path_length:.0f}",
            f"{candidate.terms.sharpness:.3f}",
            f"{candidate.score:.2f}",
        ]
        if len(readings) > 1:
            figures.insert(0, str(1 + readings.index(_describe(candidate))))
        table.add_row(*figures, style="bold green" if place == 0 else None)
    return table


def _describe(candidate: Candidate) -> str:
    """How a candidate reads the image."""
    reading = candidate.reading
    if reading.polarity == "given":
        return f"obstacles as the file says, {reading.method}"
    text = f"{reading.polarity} obstacles, {reading.method}"
    if reading.cleanup and "specks" not in reading.method:
        text += f", cleanup {reading.cleanup}"
    return text


def _print_files(console: Console, params: MapParams, folder: Path) -> None:
    preview = escape(str(folder / "preview.png"))
    console.print(f"wrote {escape(str(folder))}; look at {preview}")
    if params.start is None:
        console.print(
            "read start and goal off its rulers, then give --start X Y --goal X Y"
        )
