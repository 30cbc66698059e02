"""`tdac map`."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from rich.console import Group
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from tdac_agent.commands.console import Console
from tdac_agent.commands.flags import check_finite, in_pixels
from tdac_envs.candidates import Candidate, Preset
from tdac_envs.errors import PolarityError, TaskError
from tdac_envs.image import load_image
from tdac_envs.map_folder import write_map
from tdac_envs.maps import bundled_map, bundled_maps
from tdac_envs.params import MapParams, RobotParams, Said
from tdac_envs.preprocessing import examine

SHOWN = 8
Point = tuple[float, float]


def run(
    image: str,
    start: Point | None,
    goal: Point | None,
    robot_radius: float | None,
    snap: bool,
    metres: bool,
    said: Said,
    preset: Preset,
    out: Path | None,
    as_json: bool,
) -> None:
    """Preprocesses, writes the map folder and prints the best candidates."""
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
    radius = RobotParams().radius if robot_radius is None else robot_radius
    source = load_image(path)
    folder = out if out is not None else Path(f"{path.stem}-map")
    how: Any = {"preset": preset, "snap": snap, "heading": heading, "said": said}
    try:
        grid, params, ranked = examine(source, start, goal, radius, **how)
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
    console = Console()
    if start is None:  # no candidate has a figure, nor a place in an order
        console.print(f"reading: {escape(_describe(ranked[0]))}", highlight=False)
    else:
        console.print(_table(ranked))
    _print_choice(console, params, folder)


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


def _table(ranked: list[Candidate]) -> Group:
    """The best candidates; long descriptions of readings stand below, by number."""
    readings = list(dict.fromkeys(_describe(candidate) for candidate in ranked[:SHOWN]))
    table = Table(title="Candidates, the chosen one first", title_justify="left")
    names = ("reading", "margin", "score", "clearance", "path", "sharpness")
    for name in names:
        table.add_column(name, justify="right", no_wrap=True)
    for number, candidate in enumerate(ranked[:SHOWN]):
        terms = candidate.terms
        figures = ["–"] * 4
        if terms is not None:
            figures = [
                f"{candidate.score:.2f}",
                f"{terms.min_clearance:.1f}",
                f"{terms.path_length:.0f}",
                f"{terms.sharpness:.3f}",
            ]
        table.add_row(
            str(1 + readings.index(_describe(candidate))),
            str(candidate.inflation),
            *figures,
            style="bold green" if number == 0 else None,
        )
    lines = [f"reading {n}: {text}" for n, text in enumerate(readings, 1)]
    if len(ranked) > SHOWN:
        lines.append(f"and {len(ranked) - SHOWN} more candidates (--json lists all)")
    return Group(table, Text("\n".join(lines)))


def _describe(candidate: Candidate) -> str:
    reading = candidate.reading
    text = f"{reading.polarity} obstacles, {reading.method}"
    if reading.cleanup:
        text += f", cleanup {reading.cleanup}"
    if reading.opening:
        text += f", opening {reading.opening}"
    return text + (f" — {candidate.failure}" if candidate.failure else "")


def _print_choice(console: Console, params: MapParams, folder: Path) -> None:
    for note in params.notes:
        console.print(f"[yellow]note:[/] {escape(note)}")
    shade = {"dark": "dark", "light": "light", "mixed": "all but the floor"}
    what = shade.get(params.polarity, "as the file says")
    console.print(f"obstacles: [bold]{what}[/]; wrote {escape(str(folder))}")
    if params.start is None:
        console.print(
            "read start and goal off the rulers of "
            f"{escape(str(folder / 'preview.png'))}, then give --start X Y --goal X Y"
        )
    else:
        console.print(f"look at {escape(str(folder / 'preview.png'))}")
