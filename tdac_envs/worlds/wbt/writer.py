"""Writes a world as a flat Webots file: ENU, R2025a, obstacles without PROTOs."""

from __future__ import annotations

import re
from collections.abc import Iterable

from tdac_envs.worlds.footprint import Disc, Polygon, Rectangle
from tdac_envs.worlds.materials import MATERIAL, Contact
from tdac_envs.worlds.wbt.appearance import red_of
from tdac_envs.worlds.world import Arena, EPuck, Obstacle, Part, Unmodelled, World

_PROTOS = "https://raw.githubusercontent.com/cyberbotics/webots/R2025a/projects"
_BACKGROUNDS, _FLOORS = "objects/backgrounds", "objects/floors"
_FOLDERS = {
    "TexturedBackground": _BACKGROUNDS,
    "TexturedBackgroundLight": _BACKGROUNDS,
    "CircleArena": _FLOORS,
    "RectangleArena": _FLOORS,
    "Floor": _FLOORS,
    "E-puck": "robots/gctronic/e-puck",
}
# Looking down, x to the right.
_FROM_ABOVE = "-0.57735 0.57735 0.57735 2.0944"


def write_world(world: World, *, supervisor: bool = False) -> str:
    """The text of a `.wbt` file, from which `read_world` returns an equal world.

    Every obstacle is a top-level Solid. A single part is its boundingObject; several
    parts are each in a Pose. Unmodelled nodes appear only in comments.

    Args:
        world: The world.
        supervisor: Whether the driven e-puck is a supervisor, which can query its own
            pose; `read_world` ignores this.
    """
    externs = ["TexturedBackground", "TexturedBackgroundLight"]
    externs += dict.fromkeys(arena.kind for arena in world.arenas)
    externs += ["E-puck"] * bool(world.robots)
    blocks = [
        "\n".join(["#VRML_SIM R2025a utf8", *map(_comment, world.unmodelled), ""]),
        "\n".join([*map(_extern, externs), ""]),
        _block(
            "WorldInfo", [f"basicTimeStep {_n(world.time_step)}", *_contacts(world)]
        ),
        _block("Viewpoint", [f"orientation {_FROM_ABOVE}", _position(world)]),
        "TexturedBackground {\n}\nTexturedBackgroundLight {\n}",
        *map(_arena, world.arenas),
        *(_robot(r, supervisor and k == 0) for k, r in enumerate(world.robots)),
    ]
    if world.goal is not None and not _is_marked(world):
        blocks.append(_block("DEF GOAL Pose", [_translation(*world.goal, 0.0)]))
    blocks += map(_obstacle, world.obstacles)
    return "\n".join(blocks) + "\n"


def _contacts(world: World) -> list[str]:
    pairs = [_block("ContactProperties", _contact(c)) for c in world.contacts]
    return [_list("contactProperties", pairs)] if pairs else []


def _contact(contact: Contact) -> list[str]:
    names = (contact.one, contact.other)
    lines = [f"material{k} {_quoted(name)}" for k, name in enumerate(names, start=1)]
    return [*lines, f"coulombFriction [ {_n(contact.friction)} ]"]


def _material(thing: Arena | Obstacle) -> list[str]:
    default = thing.material == MATERIAL
    return [] if default else [f"contactMaterial {_quoted(thing.material)}"]


def _extern(name: str) -> str:
    return f'EXTERNPROTO "{_PROTOS}/{_FOLDERS[name]}/protos/{name}.proto"'


def _is_marked(world: World) -> bool:
    """Whether the first obstacle that marks the goal is at the goal."""
    marks = [(thing.x, thing.y) for thing in world.obstacles if thing.is_goal]
    return bool(marks) and marks[0] == world.goal


def _comment(node: Unmodelled) -> str:
    name = re.sub(r"\s+", " ", f"{node.kind} {node.name}").strip()
    return f"# not modelled: {name} at {_n(node.x)} {_n(node.y)}"


def _position(world: World) -> str:
    floors = [arena.inside.bounds for arena in world.arenas] or [(-1.0, -1.0, 1.0, 1.0)]
    left, low, right, high = floors[0]
    height = 2.1 * max(right - left, high - low)
    return f"position {_n((left + right) / 2)} {_n((low + high) / 2)} {_n(height)}"


def _arena(arena: Arena) -> str:
    shape = arena.inside
    lines = [_translation(shape.x, shape.y, arena.z)]
    if isinstance(shape, Disc):
        lines += [f"radius {_n(shape.radius)}", f"subdivision {arena.facets}"]
    else:
        name = "floorSize" if arena.has_wall else "size"
        lines.append(_turn(shape.yaw))
        lines.append(f"{name} {_n(shape.length)} {_n(shape.width)}")
    if arena.has_wall:
        lines.append(f"wallThickness {_n(arena.wall_thickness)}")
        lines.append(f"wallHeight {_n(arena.wall_height)}")
    lines += _material(arena)
    return _block(arena.kind, lines)


def _robot(robot: EPuck, supervisor: bool) -> str:
    lines = [_translation(robot.x, robot.y, robot.z), _turn(robot.heading)]
    lines += [f"name {_quoted(robot.name)}", f"controller {_quoted(robot.controller)}"]
    lines += ["supervisor TRUE"] if supervisor else []
    lines += ["kinematic TRUE"] if robot.kinematic else []
    return _block("E-puck", [*lines, f'version "{robot.version}"'])


def _obstacle(thing: Obstacle) -> str:
    single = _single(thing)
    if single is None:
        lines = [_translation(thing.x, thing.y, 0.0)]
    else:
        lines = _pose(single, thing.x, thing.y, 0.0, 0.0)
    if thing.visible:
        shapes = [_placed(thing, part, single, True) for part in thing.visible]
        lines.append(_list("children", shapes))
    lines.append(f"name {_quoted(thing.name)}")
    if thing.kind != "Solid":
        lines.append(f"model {_quoted(thing.kind)}")
    lines += _material(thing)
    if thing.solid:
        pieces = [_placed(thing, part, single, False) for part in thing.solid]
        body = pieces[0] if single else _block("Group", [_list("children", pieces)])
        lines.append(f"boundingObject {body}")
    if thing.mass is not None:
        lines.append(
            _block("physics Physics", ["density -1", f"mass {_n(thing.mass)}"])
        )
    return _block("DEF GOAL Solid" if thing.is_goal else "Solid", lines)


def _single(thing: Obstacle) -> Part | None:
    """The only part of an obstacle if it needs no Pose of its own, else None."""
    pieces = set(thing.solid) | set(thing.visible)
    if len(pieces) != 1 or max(len(thing.solid), len(thing.visible)) > 1:
        return None
    part = pieces.pop()
    if isinstance(part.shape, Polygon):
        return part  # written relative to the origin
    return part if (part.shape.x, part.shape.y) == (thing.x, thing.y) else None


def _placed(thing: Obstacle, part: Part, single: Part | None, visible: bool) -> str:
    """The geometry of a part, in a Shape if visible, in a Pose if one of several."""
    piece = _geometry(part, thing.x, thing.y)
    if visible:
        red = _n(red_of(thing.reflectance))
        material = _block("material Material", [f"diffuseColor {red} 0.4 0.35"])
        look = _block("appearance Appearance", [material])
        piece = _block("Shape", [look, f"geometry {piece}"])
    if single is not None:
        return piece
    lines = _pose(part, 0.0, 0.0, thing.x, thing.y)
    return _block("Pose", [*lines, _list("children", [piece])])


def _pose(part: Part, x: float, y: float, from_x: float, from_y: float) -> list[str]:
    """Pose of a part: at (x, y) for a polygon, else relative to (from_x, from_y)."""
    shape, z = part.shape, (part.bottom + part.top) / 2
    if isinstance(shape, Polygon):
        return [_translation(x, y, z)]
    lines = [_translation(shape.x - from_x, shape.y - from_y, z)]
    return lines + ([_turn(shape.yaw)] if isinstance(shape, Rectangle) else [])


def _geometry(part: Part, x: float, y: float) -> str:
    shape, height = part.shape, part.top - part.bottom
    if isinstance(shape, Disc):
        return _block(
            "Cylinder", [f"height {_n(height)}", f"radius {_n(shape.radius)}"]
        )
    if isinstance(shape, Rectangle):
        size = f"size {_n(shape.length)} {_n(shape.width)} {_n(height)}"
        return _block("Box", [size])
    return _prism(shape, height, x, y)


def _prism(shape: Polygon, height: float, x: float, y: float) -> str:
    """A polygon extruded along z, relative to (x, y)."""
    count = len(shape.points)
    points = [
        f"{_n(px - x)} {_n(py - y)} {_n(z)}"
        for z in (-height / 2, height / 2)
        for px, py in shape.points
    ]
    low, high = range(count), range(count, 2 * count)
    faces = [tuple(reversed(low)), tuple(high)]
    for k in low:
        after = (k + 1) % count
        faces.append((k, after, after + count, k + count))
    index = [" ".join(map(str, face)) + " -1" for face in faces]
    coordinate = _block("coord Coordinate", [_list("point", points)])
    return _block("IndexedFaceSet", [coordinate, _list("coordIndex", index)])


def _translation(x: float, y: float, z: float) -> str:
    return f"translation {_n(x)} {_n(y)} {_n(z)}"


def _turn(yaw: float) -> str:
    return f"rotation 0 0 1 {_n(yaw)}"


def _block(head: str, lines: Iterable[str]) -> str:
    return "\n".join([f"{head} {{", *map(_indented, lines), "}"])


def _list(name: str, items: Iterable[str]) -> str:
    return "\n".join([f"{name} [", *map(_indented, items), "]"])


def _indented(text: str) -> str:
    return "  " + text.replace("\n", "\n  ")


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'


def _n(value: float) -> str:
    """The number without exponent, with one digit more than a world keeps."""
    text = f"{value:.10f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text
