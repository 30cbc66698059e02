"""`tdac world`: shows and draws the contents of a Webots world."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import cv2
from rich.box import SIMPLE
from rich.markup import escape
from rich.table import Table

from tdac_agent.cli.console import Console, print_json
from tdac_agent.cli.map_flags import WorldOptions
from tdac_envs.core.errors import WorldError
from tdac_envs.worlds.bodies import floor_under
from tdac_envs.worlds.bundled import world_file
from tdac_envs.worlds.footprint import Disc, Polygon, Rectangle
from tdac_envs.worlds.picture import draw_world
from tdac_envs.worlds.wbt.reader import load_world
from tdac_envs.worlds.world import Arena, Obstacle, Unmodelled, World

SHOWN = 60


def run(options: WorldOptions) -> None:
    """Reads a world, draws it if a file for it is given, and prints its contents."""
    world, png = load_world(world_file(options.file)), options.png
    if png is not None:
        _draw(world, png)
    if options.as_json:
        print_json(_record(world))
        return
    console = Console()
    console.print(f"[bold]{escape(world.source)}[/], Webots {world.version}", end="")
    console.print(f", step {world.time_step:g} ms")
    console.print(_overview(world))
    console.print()
    if world.obstacles:
        console.print(_obstacles(world.obstacles))
    if world.unmodelled:
        console.print(_unmodelled(world.unmodelled))
    for note in world.notes:
        console.print(f"[yellow]note:[/] {escape(note)}")
    if any(node.may_be_solid for node in world.unmodelled):
        console.print(
            "[yellow]synth and verify refuse this world unless --ignore NAME (or TYPE) "
            "names each node that is perhaps solid[/]"
        )
    if png is not None:
        console.print(f"drew {escape(str(png))}")


def _draw(world: World, png: Path) -> None:
    if png.suffix.lower() != ".png":
        raise WorldError(f"--png must end in .png, got {png}")
    _, data = cv2.imencode(".png", draw_world(world)[..., ::-1])
    png.parent.mkdir(parents=True, exist_ok=True)
    png.write_bytes(data.tobytes())


def _overview(world: World) -> Table:
    """A table of robots, goal and arenas."""
    table = Table.grid(padding=(0, 2))
    for index, robot in enumerate(world.robots):
        label = "e-puck" if index == 0 else "stands still"
        pose = f"{_point(robot.x, robot.y)}, heading {_rounded(robot.heading)} rad"
        name = "" if robot.name == "e-puck" else f"{escape(robot.name)}: "
        table.add_row(label, f"{name}{pose}, version {robot.version}")
    if not world.robots:
        table.add_row("e-puck", "none in this file")
    goal = "none: needs --goal X Y" if world.goal is None else _point(*world.goal)
    table.add_row("goal", goal)
    for arena in world.arenas:
        table.add_row("arena", f"{arena.kind} at {_floor(arena)}")
    return table


def _floor(arena: Arena) -> str:
    shape = arena.inside
    if isinstance(shape, Disc):
        size = f"radius {shape.radius:g} m"
    else:
        turned = f", yaw {_rounded(shape.yaw)} rad" if shape.yaw else ""
        size = f"{shape.length:g} x {shape.width:g} m{turned}"
    if not arena.has_wall:
        return f"{_point(shape.x, shape.y)}, {size}, no wall"
    wall = f"wall {arena.wall_thickness:g} x {arena.wall_height:g} m"
    return f"{_point(shape.x, shape.y)}, {size}, {wall}"


def _obstacles(obstacles: Iterable[Obstacle]) -> Table:
    """A row per obstacle, rounded to millimetres; `--json` prints all digits."""
    things = list(obstacles)
    count = f"{len(things)} obstacle{'' if len(things) == 1 else 's'} (m, rad, kg)"
    rows = [_obstacle(thing) for thing in things[:SHOWN]]
    shown = {name for row in rows for name, value in row.items() if value}
    table = _table(count, *(name for name in rows[0] if name in shown))
    if any(not thing.solid for thing in things):
        table.caption, table.caption_justify = " * visible but not solid", "left"
    for row in rows:
        table.add_row(*(value for name, value in row.items() if name in shown))
    if len(things) > SHOWN:
        table.add_row("…", f"{len(things) - SHOWN} more", "--json lists all")
    return table


def _obstacle(thing: Obstacle) -> dict[str, str]:
    return {
        "name": escape(thing.name),
        "type": escape(thing.kind),
        "at": _point(thing.x, thing.y),
        "footprint": _footprint(thing),
        "yaw": _yaw(thing),
        "height": _heights(thing),
        "mass": "" if thing.mass is None else f"{thing.mass:.3g}",
        "f": f"{thing.reflectance:.2g}" if thing.visible else "",
    }


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left", box=SIMPLE, padding=(0, 1, 0, 0))
    for name in columns:
        table.add_column(name)
    return table


def _heights(thing: Obstacle) -> str:
    """The top of an obstacle; `bottom…top` if it does not stand on the floor."""
    parts = thing.solid or thing.visible
    if not parts:
        return ""
    bottom, top = min(p.bottom for p in parts), _rounded(max(p.top for p in parts))
    hangs = bottom > 0.0 and _rounded(bottom) not in ("0", top)
    return f"{_rounded(bottom)}…{top}" if hangs else top


def _footprint(thing: Obstacle) -> str:
    parts = thing.solid or thing.visible
    if not parts:
        return "marker"
    shape = parts[0].shape
    ghost = "" if thing.solid else " *"
    if len(parts) > 1:
        return f"{len(parts)} pieces{ghost}"
    if isinstance(shape, Disc):
        return f"radius {shape.radius:.4g}{ghost}"
    if isinstance(shape, Rectangle):
        return f"{shape.length:.4g} x {shape.width:.4g}{ghost}"
    return f"{len(shape.points)} corners{ghost}"


def _yaw(thing: Obstacle) -> str:
    parts = thing.solid or thing.visible
    alone = parts[0].shape if len(parts) == 1 else None
    return _rounded(alone.yaw) if isinstance(alone, Rectangle) else ""


def _unmodelled(nodes: tuple[Unmodelled, ...]) -> Table:
    table = _table("Not modelled", "name", "type", "at", "line", "solid", "why")
    for node in nodes[:SHOWN]:
        table.add_row(
            escape(node.name),
            escape(node.kind),
            _point(node.x, node.y),
            str(node.line),
            "[yellow]perhaps[/]" if node.may_be_solid else "no",
            escape(node.why),
        )
    if len(nodes) > SHOWN:
        table.add_row("…", f"{len(nodes) - SHOWN} more", "--json lists all")
    return table


def _point(x: float, y: float) -> str:
    return f"({_rounded(x)}, {_rounded(y)})"


def _rounded(value: float) -> str:
    """A number with at most three decimals."""
    return f"{round(value, 3) + 0.0:.3f}".rstrip("0").rstrip(".")


def _record(world: World) -> dict[str, Any]:
    """The JSON record of a world, in metres and radians, ENU."""
    record = asdict(world)
    record["floor"] = floor_under(world)
    pairs = zip(world.obstacles, record["obstacles"], strict=True)
    for thing, entry in pairs:
        for key, parts in (("solid", thing.solid), ("visible", thing.visible)):
            for part, piece in zip(parts, entry[key], strict=True):
                piece["kind"] = type(part.shape).__name__.lower()
                if not isinstance(part.shape, Disc | Polygon):
                    piece["vertices"] = part.shape.vertices.tolist()
    for arena, entry in zip(world.arenas, record["arenas"], strict=True):
        entry["kind"] = arena.kind
    for robot, entry in zip(world.robots, record["robots"], strict=True):
        entry["max_wheel_speed"] = robot.max_wheel_speed
    return record
