"""`tdac sets` and `tdac sets show`: task sets, their worlds as figures and pictures."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import cv2
import typer
from rich.box import SIMPLE
from rich.markup import escape
from rich.table import Table

from tdac_agent.cli.console import Console, print_json
from tdac_agent.cli.sentences import print_plain, print_sentences
from tdac_agent.cli.sets_flags import ShowSetOptions
from tdac_agent.verification.judge.sequential import MARGIN
from tdac_agent.verification.judge.set_worlds import movers_of
from tdac_envs.core.errors import TaskError
from tdac_envs.drawing.canvas import Image
from tdac_envs.epuck.infrared import RANGE
from tdac_envs.ladder.dead_ends import RangeSensor, dead_ends
from tdac_envs.ladder.frozen import ladder_of
from tdac_envs.ladder.generators.blocks import PIXEL
from tdac_envs.ladder.moving import MoversOfSet
from tdac_envs.ladder.picture import AHEAD, contact_sheet, draw_world
from tdac_envs.ladder.plate_worlds import PlatesWorld
from tdac_envs.ladder.robots import EPuckRobotParams
from tdac_envs.ladder.set_file import SetFile, shipped_names
from tdac_envs.ladder.shown import in_shown_units
from tdac_envs.ladder.task_sets import AnyTask, AnyWorld, TaskSet, load_set
from tdac_envs.ladder.worlds import LadderWorld
from tdac_envs.mapping.ray_angles import fan
from tdac_envs.worlds.bodies import BODY_RADIUS

ON_A_SHEET = 24
"""Worlds of a contact sheet."""
LONGEST_CAPTION = 14
"""Longest name of a world on a contact sheet, letters."""


def list_sets(context: typer.Context, as_json: bool) -> None:
    """Prints the task sets that come with the package, unless one is to be shown."""
    if context.invoked_subcommand is not None:
        return
    sets = [load_set(name) for name in shipped_names()]
    if as_json:
        print_json([_record(each) for each in sets])
        return
    console = Console()
    table = Table(box=SIMPLE, padding=(0, 1, 0, 0))
    for column in ("set", "observed", "what it asks"):
        table.add_column(column)
    for each in sets:
        seen = ", ".join(each.file.observed) + (", the map" if each.file.map else "")
        table.add_row(f"[bold]{each.name}[/]", seen, escape(each.file.description))
    console.print(table)
    print_sentences(
        console,
        'gym.make("TDAC-Ladder-v0", level="unknown") drives on one; '
        "tdac sets show NAME shows it and its worlds",
    )


def show(options: ShowSetOptions) -> None:
    """Prints a task set and the figures of a world, and draws worlds.

    Raises:
        TaskError: There is no such set or world, or a file does not end in `.png`.
    """
    split, index, as_json = options.split.value, options.index, options.as_json
    png, sheet = options.png, options.sheet
    for flag, path in (("--png", png), ("--sheet", sheet)):
        if path is not None and path.suffix.lower() != ".png":
            raise TaskError(f"{flag} must end in .png, got {path}")
    tasks, first = load_set(options.name), index or 0
    wanted = index is not None or png is not None
    shown = tasks.world_and_task(split, first) if wanted else None
    record = _record(tasks)
    if shown is not None:
        record["world"] = _world_record(tasks, *shown, split, first)
    if as_json:
        print_json(record)
    else:
        _print_set(Console(), tasks, record)
    if png is not None and shown is not None:
        _write(draw_world(tasks, *shown), png, as_json)
    if sheet is not None:
        count = tasks.count(split)
        last = first + ON_A_SHEET if count is None else min(first + ON_A_SHEET, count)
        # A number beyond the last world is an error of `world`.
        numbers = range(first, max(last, first + 1))
        worlds = [tasks.world_and_task(split, index) for index in numbers]
        captions = [
            _caption(tasks.label(split, index).split()[-1], world, index)
            for index, (world, _) in zip(numbers, worlds, strict=True)
        ]
        _write(contact_sheet(tasks, worlds, captions), sheet, as_json)
    if not as_json and (png or sheet):
        Console().print(_legend(tasks), style="dim", highlight=False)


def _legend(tasks: TaskSet) -> str:
    """What the marks of a picture are."""
    text = "blue: robot at its start; green: goal; dashed: shortest path"
    if tasks.file.movers:
        text += f"; red: movers, and where they go in the first {AHEAD:g} s"
    return text


def _record(tasks: TaskSet) -> dict[str, Any]:
    """The set as JSON: all values, with the defaults, their unit and their hash.

    The lengths are those of the worlds: px on maps, also if the set is in metres.
    """
    values = tasks.file.model_dump(mode="json", by_alias=True)
    if tasks.files is None:
        del values["files"]
    else:
        own = {"counts": tasks.files.counts, "skipped": list(tasks.files.skipped)}
        values["files"] |= own
    values["unit"] = tasks.file.unit
    return {**values, "sha256": tasks.sha256, "dynamics": tasks.dynamics}


def _world_record(
    tasks: TaskSet, world: AnyWorld, task: AnyTask, split: str, index: int
) -> dict[str, Any]:
    file, raster, pixel = tasks.file, world, 1.0
    if isinstance(raster, PlatesWorld):
        raster, pixel = raster.raster, PIXEL / 1000
    assert isinstance(raster, LadderWorld)
    lost = dead_ends(raster, file.robot.radius / pixel, _sensor(file, pixel))
    height, width = raster.cells.shape
    return {
        "split": split,
        "index": index,
        "generator": tasks.label(split, index),
        "width": round(width * pixel, 3),
        "height": round(height * pixel, 3),
        "start": list(world.start),
        "goal": list(world.goal),
        "horizon": tasks.file.horizon.steps(world.difficulty.steps),
        **asdict(world.difficulty),
        "dead_ends": lost.depth,
        "excess": lost.excess,
        "rejected_drafts": len(world.rejected),
        **movers_of(task),
    }


def _sensor(file: SetFile, pixel: float) -> RangeSensor:
    """The robot's sensor for `dead_ends`; that of an e-puck looks all around."""
    robot = file.robot
    if isinstance(robot, EPuckRobotParams):
        return RangeSensor(fan(315.0, 8), (BODY_RADIUS + RANGE) / pixel)
    return RangeSensor(robot.angles(), robot.range_max)


def _print_set(console: Console, tasks: TaskSet, record: dict[str, Any]) -> None:
    file = in_shown_units(tasks.file)
    ladder = ladder_of(tasks.name, tasks.sha256, tasks.dynamics)
    hashes = f"{tasks.sha256[:12]}, dynamics {tasks.dynamics[:12]}"
    known = f"; {ladder}" if ladder else ""
    console.print(f"[bold]{escape(tasks.name)}[/]  {hashes}{known}")
    if file.description:
        print_sentences(console, file.description)
    frame = "the map's frame" if file.frame == "map" else "the start's frame"
    rows = {
        "worlds": _worlds(tasks),
        "robot": f"{_robot(file)}, steps of {file.dt:g} s",
        "observed": f"{', '.join(file.observed)}, in {frame}"
        + ("; the map is given" if file.map else ""),
        "disturbed": _disturbed(file) or "nothing",
        "horizon": _horizon(file),
        "verified": f"if a sequential test accepts a success rate of {file.bar:g} "
        f"against {file.bar - MARGIN:g}, and fewer contacts than "
        f"{100 * file.most_contacts:g} %",
    }
    if file.movers:
        unit = file.shown_unit
        rows["movers"] = "; ".join(_group(group, unit) for group in file.movers)
    world = record.get("world")
    if world is not None:
        rows |= _world_rows(world, file.shown_unit, file.per_unit)
    table = Table.grid(padding=(0, 2))
    for label, text in rows.items():
        table.add_row(label, escape(text))
    console.print(table)


def _worlds(tasks: TaskSet) -> str:
    """Which generators make the worlds, or how many each split has of a file."""
    if tasks.files is None or tasks.file.files is None:
        names = ", ".join(each.name for each in tasks.file.worlds)
        return f"{names}, in turn" if len(tasks.file.worlds) > 1 else names
    counts = ", ".join(
        f"{count} {split}" for split, count in tasks.files.counts.items()
    )
    runs = tasks.files.runs
    times = f" ({runs} runs on each world)" if runs > 1 else ""
    text = f"{counts}{times}; of {tasks.file.files.path}"
    skipped = tasks.files.skipped
    if skipped:
        text += f"; {len(skipped)} left out (--json lists them), such as {skipped[0]}"
    return text


def _horizon(file: SetFile) -> str:
    own = file.horizon
    if own.least == own.most:
        return f"{own.most} steps"
    return f"{own.factor:g} OT, {own.least} to {own.most} steps"


def _robot(file: SetFile) -> str:
    robot, unit = file.robot, file.shown_unit
    speed = f"{file.full_step / file.dt:g} {unit}/s"
    if isinstance(robot, EPuckRobotParams):
        return f"e-puck, radius {robot.radius:g} m, {speed}"
    return (
        f"radius {robot.radius:g} {unit}, axle {robot.axle_length:g} {unit}, {speed}, "
        f"{robot.n_rays} rays over "
        f"{robot.field_of_view_deg:g}° up to {robot.range_max:g} {unit}"
    )


def _disturbed(file: SetFile) -> str:
    values = file.disturbances.model_dump()
    if isinstance(file.robot, EPuckRobotParams):
        values |= file.robot.errors
    sizes = {name: value for name, value in values.items() if value}
    return ", ".join(f"{name} {value:g}" for name, value in sizes.items())


def _group(group: MoversOfSet, unit: str) -> str:
    """A group of movers: kind, number, radius and speed."""
    count, radius, speed = (
        f"{low:g}" if low == high else f"{low:g} to {high:g}"
        for low, high in (group.count, group.radius, group.speed)
    )
    kind = "people of a crowd" if group.kind == "crowd" else "bouncing discs"
    rest = f"radius {radius} {unit}, {speed} {unit}/s; fewer where they block every way"
    return f"{count} {kind}, {rest}"


def _world_rows(world: dict[str, Any], unit: str, size: float) -> dict[str, str]:
    """The figures of a world, by label; `size` is that of its lengths in the unit.

    Start and goal are where the world has them: for an e-puck in m, else in px.
    """
    x, y, heading = world["start"]
    goal_x, goal_y = world["goal"]
    sides = f"{size * world['width']:g} x {size * world['height']:g} {unit}"
    place = "" if size == 1.0 else " px"
    among = {}
    if "movers" in world:
        speed = f"{world['mover_speed']:.2f} of the robot's speed on average"
        among["movers here"] = f"{world['movers']}, {speed}"
    return {
        f"{world['split']} {world['index']}": f"{world['generator']}, "
        f"{sides}, start ({x:g}, {y:g}){place}, heading {heading:.3f} rad, goal "
        f"({goal_x:g}, {goal_y:g}){place}",
        "shortest": f"{size * world['length']:.4g} {unit}, "
        f"{world['detour']:.2f} times the straight distance; "
        f"OT {world['steps']:.1f} steps, horizon {world['horizon']}",
        "gap": f"{world['gap']:.2f} body diameters at the narrowest place",
        "dead ends": _dead_ends(world["dead_ends"], world["excess"]),
        "in sight": f"the goal, from {world['in_sight']:.0%} of the path; "
        f"{world['density']:.0%} of the floor is occupied",
        **among,
    }


def _dead_ends(depth: float, excess: float) -> str:
    farther = f"without a map, the way is {1.0 + excess:.2f} times as long"
    if depth < 0.005:
        return f"none; {farther}"
    return f"up to {depth:.2f} of the shortest path deep; {farther}"


def _caption(name: str, world: AnyWorld, index: int) -> str:
    hard = world.difficulty
    if len(name) > LONGEST_CAPTION:
        name = f"{name[: LONGEST_CAPTION - 2]}.."
    return f"{index} {name}  gap {hard.gap:.2f}  OT {hard.steps:.0f}"


def _write(image: Image, path: Path, quiet: bool) -> None:
    _, data = cv2.imencode(".png", image[..., ::-1])
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data.tobytes())
    if not quiet:
        print_plain(Console(), f"drew {path}")
