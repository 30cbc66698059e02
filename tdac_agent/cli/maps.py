"""`tdac map`: preprocesses a map image and shows the candidates."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from rich.markup import escape
from rich.table import Table

from tdac_agent.cli.console import Console, print_json
from tdac_agent.cli.map_flags import MapOptions
from tdac_agent.cli.sentences import print_plain, print_sentences
from tdac_agent.cli.task_changes import in_pixels
from tdac_agent.cli.task_choice import IN_METRES, check_values, in_own_units
from tdac_agent.cli.task_flags import TaskFlags
from tdac_agent.environments.map2d.task_robot import robot_text
from tdac_envs.core.errors import PicturedError, TaskError
from tdac_envs.drive.task import Pose
from tdac_envs.grid.grid import OccupancyGrid
from tdac_envs.grid.map_units import PIXELS, MapUnits
from tdac_envs.grid.plan import Path as Path2D
from tdac_envs.grid.plan import path_length
from tdac_envs.map2d.robot_options import options_of
from tdac_envs.map2d.source import metric_units, units_of
from tdac_envs.map2d.task import Terrain, make_task
from tdac_envs.mapping.bundled import BundledMap, bundled_map, bundled_maps
from tdac_envs.mapping.candidates import MapCandidate
from tdac_envs.mapping.map_files import load_image
from tdac_envs.mapping.map_folder import write_map
from tdac_envs.mapping.params import MapParams, ReadingOptions
from tdac_envs.mapping.preprocessing import preprocess_with_candidates
from tdac_envs.mapping.ros_writer import ROS_FILES, write_ros_map
from tdac_envs.mapping.wording import obstacles_text, scale_text
from tdac_envs.robots.bundled import load_robot

SHOWN, EXPLAINED = 8, 2
LEGEND = (
    "margin: distance that the planner keeps in addition to the body radius",
    "grid path: length of the path from pixel to pixel that keeps this margin",
    "clearance: smallest distance between this path and an obstacle",
    "sharpness: changes between free and occupied, per pixel",
    "score: 2.5 clearance - 0.02 grid path - 1.2 sharpness, in px; highest is best",
)


def run(options: MapOptions, flags: TaskFlags) -> None:
    """Preprocesses a map, writes its folder and prints the best candidates."""
    if (flags.start is None) != (flags.goal is None):
        raise TaskError("give both --start X Y and --goal X Y, or neither")
    check_values(flags)
    path, scale = Path(options.image), flags.resolution
    if options.image in bundled_maps():
        bundled = bundled_map(options.image)
        path, flags = bundled.image, _or_else(flags, bundled)
    flags = in_own_units(flags, options.image)
    frame = "metres" if flags.in_metres else "pixels"
    units = units_of(path, frame, scale).with_typed(flags.start, flags.goal)
    task = in_pixels(flags, units)
    if task.start is None and task.heading is not None:
        raise TaskError("--heading needs --start X Y")
    source = load_image(path, scale)
    if options.ros and source.resolution is None:
        raise TaskError(
            f"--yaml: {source.name} gives no resolution; add --resolution METRES"
        )
    folder = options.out or Path(f"{path.stem}-map")
    try:
        grid, params, ranked = preprocess_with_candidates(
            source,
            task.start,
            task.goal,
            _radius(task, str(path)),
            preset=options.preset,
            snap=task.snap,
            heading=task.heading or 0.0,
            options=ReadingOptions(task.polarity, task.threshold),
            units=units,
        )
    except PicturedError as error:
        error.folder = folder
        raise
    shortest = _shortest_path(grid, params)
    files = write_map(folder, grid, params, source, units, shortest)
    if options.ros and params.resolution is not None:
        files += write_ros_map(folder, grid, params.resolution, params.origin)
    if options.as_json:
        rows = [_row(candidate) for candidate in ranked]
        record = {
            "params": params.model_dump(mode="json"),
            "candidates": rows,
            "files": [str(file) for file in files],
        }
        print_json(record)
        return
    console = Console(highlight=False)
    _print_reading(console, params, ranked[0], units)
    if task.start is not None:  # candidates have figures only if there is a task
        _print_candidates(console, ranked, units)
        _print_drive(console, params, shortest, units, flags.robot)
    _print_files(console, params, folder, units)
    if options.ros:
        yaml = folder / ROS_FILES[0]
        print_plain(
            console, f"the grid as a ROS map: {yaml} ({params.resolution:g} m per px)"
        )


def _radius(flags: TaskFlags, source: str) -> float | None:
    """The body's radius, px: as typed, or else of the robot that the flags name."""
    if flags.robot is None or flags.robot_radius is not None:
        return flags.robot_radius
    metric = metric_units(source, flags.resolution)
    own = options_of(load_robot(flags.robot), metric, False, disturbed=False)
    return float(own["robot_radius"])


def _or_else(flags: TaskFlags, bundled: BundledMap) -> TaskFlags:
    """The flags, with the values of a bundled map instead of None."""
    return replace(
        flags,
        start=flags.start or bundled.start,
        goal=flags.goal or bundled.goal,
        heading=bundled.heading if flags.heading is None else flags.heading,
        robot_radius=flags.robot_radius or bundled.robot_radius,
    )


def _shortest_path(grid: OccupancyGrid, params: MapParams) -> Path2D | None:
    """The task's shortest path, px; None without a task or a path."""
    if params.start is None or params.goal is None:
        return None
    terrain, start = Terrain.of(grid), Pose(*params.start, params.heading)
    try:
        task = make_task(terrain, start, params.goal, params.robot)
    except TaskError:  # for example, start and goal are the same
        return None
    return task.shortest_path(start)


def _print_drive(
    console: Console,
    params: MapParams,
    shortest: Path2D | None,
    units: MapUnits,
    robot: str | None,
) -> None:
    """Prints the shortest path and, in metres, the robot."""
    if shortest is not None:
        length = units.length(path_length(shortest), 0)
        console.print(f"shortest path {length}: with every shortcut for this body")
    if units != PIXELS:
        text = robot_text(params.robot, units)
        if robot is not None:
            radius = units.written_length(params.robot.radius)
            text = f"robot: {robot}, radius {radius:g} {units.name}"
        console.print(escape(text), soft_wrap=True)
        print_sentences(
            console,
            "metres of the map's frame; here, start and goal are the centres of the "
            f"pixels ({params.resolution:g} m each) that contain them",
        )


def _row(candidate: MapCandidate) -> dict[str, object]:
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


def _print_reading(
    console: Console, params: MapParams, chosen: MapCandidate, units: MapUnits
) -> None:
    """Prints the map's name and size, how it was read, and the notes."""
    size = f"{params.width} x {params.height} px"
    if units != PIXELS:
        size += f" ({units.length(params.width)} x {units.length(params.height)})"
    reading = f"{_describe(chosen)}; {scale_text(params.resolution)}"
    print_sentences(console, f"{params.source}, {size}: {reading}")
    for note in params.notes:
        console.print(f"[yellow]note:[/] {escape(note)}")


def _print_candidates(
    console: Console, ranked: list[MapCandidate], units: MapUnits
) -> None:
    """Prints the best candidates with a legend, and why others are infeasible."""
    feasible = [c for c in ranked if c.terms is not None]
    readings = list(dict.fromkeys(_describe(c) for c in feasible[:SHOWN]))
    console.print(_table(feasible[:SHOWN], readings, units))
    for number, reading in enumerate(readings, 1):
        if len(readings) > 1:
            console.print(f"reading {number}: {escape(reading)}")
    for line in LEGEND:
        console.print(f"[dim]{line}[/]")
    failed = [c for c in ranked if c.terms is None]
    if failed:
        console.print("[dim]Not chosen, since the robot could not drive there:[/]")
    for candidate in failed[:EXPLAINED]:
        text = _describe(candidate)
        if candidate.inflation:
            text += f", margin {units.length(candidate.inflation)}"
        failure = escape(candidate.failure or "")
        console.print(f"[dim]  {escape(text)}: {failure}[/]")
    hidden = max(len(feasible) - SHOWN, 0) + max(len(failed) - EXPLAINED, 0)
    if hidden:
        more = "1 more candidate" if hidden == 1 else f"{hidden} more candidates"
        console.print(f"and {more} (--json lists all)")


def _table(
    candidates: list[MapCandidate], readings: list[str], units: MapUnits
) -> Table:
    """The figures of feasible candidates, with their reading if there are several."""
    table = Table(title="Candidates, the chosen one first", title_justify="left")
    lengths = [f"{name}, {units.name}" for name in ("margin", "clearance", "grid path")]
    names = [*lengths, "sharpness", "score"]
    for name in names if len(readings) == 1 else ["reading", *names]:
        table.add_column(name, justify="right", no_wrap=True)
    for place, candidate in enumerate(candidates):
        assert candidate.terms is not None
        figures = [
            units.number(candidate.inflation, 0),
            units.number(candidate.terms.min_clearance, 1),
            units.number(candidate.terms.path_length, 0),
            f"{candidate.terms.sharpness:.3f}",
            f"{candidate.score:.2f}",
        ]
        if len(readings) > 1:
            figures.insert(0, str(1 + readings.index(_describe(candidate))))
        table.add_row(*figures, style="bold green" if place == 0 else None)
    return table


def _describe(candidate: MapCandidate) -> str:
    """How a candidate reads the image."""
    reading = candidate.reading
    text = obstacles_text(reading)
    if reading.cleanup and "specks" not in reading.method:
        text += f"; cleaned with strength {reading.cleanup}"
    return text


def _print_files(
    console: Console, params: MapParams, folder: Path, units: MapUnits
) -> None:
    preview = escape(str(folder / "preview.png"))
    console.print(f"wrote {escape(str(folder))}; look at {preview}")
    if params.start is None:
        console.print(
            "read start and goal off its rulers, then give --start X Y --goal X Y"
        )
    if params.resolution is None and params.start is None:
        print_sentences(console, IN_METRES)
    if params.resolution is not None and units == PIXELS:
        console.print(
            "these places and lengths are in px; with --metres, flags, rulers and "
            "figures are in metres of the map's frame"
        )
