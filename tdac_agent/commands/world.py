"""`tdac world`."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import cv2
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from tdac_envs.bodies import floor_under
from tdac_envs.errors import WorldError
from tdac_envs.footprint import Disc, Polygon, Rectangle
from tdac_envs.wbt.reader import load_world
from tdac_envs.world import Arena, Obstacle, Unmodelled, World
from tdac_envs.world_picture import draw_world
from tdac_envs.worlds import world_file

SHOWN = 60


def run(file: str, png: Path | None, as_json: bool) -> None:
    """Reads a world, draws it where asked to, and prints what is in it."""
    world = load_world(world_file(file))
    if png is not None:
        _draw(world, png)
    if as_json:
        sys.stdout.write(json.dumps(_record(world), indent=2) + "\n")
        return
    console = Console(emoji=False)
    console.print(f"[bold]{escape(world.source)}[/], Webots {world.version}", end="")
    console.print(f", step {world.time_step:g} ms")
    console.print(_people(world))
    if world.obstacles:
        console.print(_obstacles(world.obstacles))
    if world.unmodelled:
        console.print(_unmodelled(world.unmodelled))
    for note in world.notes:
        console.print(f"[yellow]note:[/] {escape(note)}")
    if any(node.may_be_solid for node in world.unmodelled):
        console.print(
            "[yellow]synth and verify refuse this world, unless each of these nodes "
            "is named by --ignore NAME (or TYPE)[/]"
        )
    if png is not None:
        console.print(f"drew {escape(str(png))}")


def _draw(world: World, png: Path) -> None:
    if png.suffix.lower() != ".png":
        raise WorldError(f"--png: expected a file that ends in .png, got {png}")
    _, data = cv2.imencode(".png", draw_world(world)[..., ::-1])
    png.parent.mkdir(parents=True, exist_ok=True)
    png.write_bytes(data.tobytes())


def _people(world: World) -> Table:
    """Robots, goal and floors."""
    table = Table(show_header=False)
    for index, robot in enumerate(world.robots):
        what = "e-puck" if index == 0 else "stands still"
        pose = f"{_at(robot.x, robot.y)}, heading {robot.heading:.4f} rad"
        table.add_row(what, escape(robot.name), f"{pose}, version {robot.version}")
    if not world.robots:
        table.add_row("e-puck", "–", "none in this file")
    goal = "none in this file: give one" if world.goal is None else _at(*world.goal)
    table.add_row("goal", "", goal)
    for arena in world.arenas:
        table.add_row("arena", arena.kind, _floor(arena))
    return table


def _floor(arena: Arena) -> str:
    shape = arena.inside
    if isinstance(shape, Disc):
        size = f"radius {shape.radius:g} m"
    else:
        size = f"{shape.length:g} x {shape.width:g} m, yaw {shape.yaw:.4f} rad"
    if not arena.has_wall:
        return f"{_at(shape.x, shape.y)}, {size}, no wall"
    wall = f"wall {arena.wall_thickness:g} m thick, {arena.wall_height:g} m high"
    return f"{_at(shape.x, shape.y)}, {size}, {wall}"


def _obstacles(obstacles: Iterable[Obstacle]) -> Table:
    things = list(obstacles)
    table = Table(title=f"{len(things)} obstacles", title_justify="left")
    for name in ("name", "type", "footprint", "height", "mass", "f"):
        table.add_column(name)
    for thing in things[:SHOWN]:
        parts = thing.solid or thing.visible
        bottom = min((part.bottom for part in parts), default=0.0)
        top = max((part.top for part in parts), default=0.0)
        table.add_row(
            escape(thing.name),
            escape(thing.kind),
            _footprint(thing),
            f"{bottom:.3f} … {top:.3f}" if parts else "",
            "" if thing.mass is None else f"{thing.mass:.3g} kg",
            f"{thing.reflectance:.2f}" if thing.visible else "",
        )
    if len(things) > SHOWN:
        table.add_row("…", f"{len(things) - SHOWN} more", "--json lists all")
    return table


def _footprint(thing: Obstacle) -> str:
    parts = thing.solid or thing.visible
    ghost = "" if thing.solid else " (not solid)"
    if not parts:
        return f"a mark at {_at(thing.x, thing.y)}"
    shape = parts[0].shape
    if len(parts) > 1:
        return f"{len(parts)} pieces at {_at(thing.x, thing.y)}{ghost}"
    if isinstance(shape, Disc):
        return f"disc {_at(shape.x, shape.y)}, radius {shape.radius:.4g}{ghost}"
    if isinstance(shape, Rectangle):
        size = f"{shape.length:.4g} x {shape.width:.4g}"
        return f"{size} at {_at(shape.x, shape.y)}, yaw {shape.yaw:.4f}{ghost}"
    return f"{len(shape.points)} corners at {_at(thing.x, thing.y)}{ghost}"


def _unmodelled(nodes: tuple[Unmodelled, ...]) -> Table:
    table = Table(title="Not modelled", title_justify="left")
    for name in ("name", "type", "at", "line", "why", "may be solid"):
        table.add_column(name)
    for node in nodes[:SHOWN]:
        table.add_row(
            escape(node.name),
            escape(node.kind),
            _at(node.x, node.y),
            str(node.line),
            escape(node.why),
            "[yellow]yes[/]" if node.may_be_solid else "no",
        )
    if len(nodes) > SHOWN:
        table.add_row("…", f"{len(nodes) - SHOWN} more", "--json lists all")
    return table


def _at(x: float, y: float) -> str:
    return f"({x:.4f}, {y:.4f})"


def _record(world: World) -> dict[str, Any]:
    """Everything, in metres and radians, ENU."""
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
