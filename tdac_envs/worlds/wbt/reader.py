"""Reads Webots worlds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from tdac_envs.core.arguments import finite_point
from tdac_envs.core.errors import WorldError, WorldFileError, file_hint
from tdac_envs.core.intake import printable, read_file
from tdac_envs.worlds.bodies import bodies, floor_under
from tdac_envs.worlds.materials import (
    FRICTION,
    INFINITE_FRICTION,
    MATERIAL,
    Contact,
)
from tdac_envs.worlds.wbt.content import WorldContent
from tdac_envs.worlds.wbt.fields import children, number, number_list, numbers, text
from tdac_envs.worlds.wbt.frames import NodeFrame, world_frame
from tdac_envs.worlds.wbt.protofiles import ProtoFolder
from tdac_envs.worlds.wbt.tree import Document, WbtNode, parse
from tdac_envs.worlds.wbt.unknown import unknown_fields, without_odd_scales
from tdac_envs.worlds.wbt.walk import walk
from tdac_envs.worlds.world import EPuck, World

LARGEST_FILE = 8_000_000
"""Maximum size of a world file, bytes."""

_FLU_SINCE = (2022, 1)
_ENU_SINCE = (2020, 2)
_Z_UP = {"ENU": True, "NUE": False, "EUN": False}
_STEP = 32.0
_RAISED = 0.005


def load_world(
    path: str | Path,
    *,
    robot: str | None = None,
    goal: Sequence[float] | None = None,
) -> World:
    """Reads a `.wbt` file of Webots V6 to R2025a.

    Everything in the file becomes part of the world, or is listed in its `unmodelled`
    or `notes`.

    Args:
        path: The file.
        robot: Name of the e-puck to drive; by default the first.
        goal: Point (x, y), m, ENU; by default the position of the node named GOAL.

    Raises:
        WorldError: The file cannot be read or is invalid; errors in the file are
            reported with line and column.
    """
    file = Path(path)
    name = printable(file.name)
    return read_world(read_text(file), name, robot=robot, goal=goal, folder=file.parent)


def read_world(
    content: str,
    name: str = "world.wbt",
    *,
    robot: str | None = None,
    goal: Sequence[float] | None = None,
    folder: Path | None = None,
) -> World:
    """Reads the text of a `.wbt` file; see `load_world`.

    Args:
        content: The text.
        name: Name of the file.
        robot: See `load_world`.
        goal: See `load_world`.
        folder: Folder of the file, for the project's PROTOs; None to use none.
    """
    document, odd = _read(content, name, folder)
    info, frame = _world_info(document), frame_of(document)
    found = WorldContent()
    for node in document.nodes:
        try:
            walk(node, frame, found)
        except WorldFileError:
            raise
        except WorldError as error:  # a value that is invalid for its shape
            raise node.error(str(error)) from None
    world = World(
        robots=_driven_first(found.robots, robot, name),
        goal=found.goals[0] if found.goals else None,
        arenas=tuple(found.arenas),
        obstacles=tuple(found.obstacles),
        time_step=_time_step(info, found),
        contacts=_contacts(info),
        unmodelled=tuple(found.unmodelled),
        source=name,
        version=document.version,
    )
    if goal is not None:
        world = with_goal(world, finite_point("goal", goal))
    return replace(world, notes=(*found.notes, *odd, *_notes(world, found)))


def _read(content: str, name: str, folder: Path | None) -> tuple[Document, list[str]]:
    """The nodes of a file, and notes on fields that they do not have."""
    document = parse(content, name)
    made, own = without_odd_scales(document), dict[str, Iterable[str]]()
    if folder is not None:
        protos = ProtoFolder(folder, document.version)
        made, own = protos.expanded(made), protos.fields()
    return made, unknown_fields(document, own)


def with_goal(world: World, goal: tuple[float, float]) -> World:
    """The world with another goal; its goal markers become ordinary obstacles."""
    marks = tuple(replace(thing, is_goal=False) for thing in world.obstacles)
    return replace(world, goal=goal, obstacles=marks)


def read_text(path: Path) -> str:
    """The text of a file.

    Raises:
        WorldError: The file cannot be read, or is too large.
    """
    try:
        data = read_file(path, LARGEST_FILE)
    except FileNotFoundError:
        raise WorldError(
            f"{path}: no such file{file_hint(path)}; check the path"
        ) from None
    except IsADirectoryError:
        raise WorldError(f"{path}: is a folder; give the .wbt file in it") from None
    except OSError as error:
        raise WorldError(f"{path}: cannot be read: {error.strerror}") from error
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")  # old files may have Latin-1 comments


def frame_of(document: Document) -> NodeFrame:
    """The frame of the top-level nodes of a file.

    Raises:
        WorldFileError: The file names an unknown coordinate system.
    """
    info = _world_info(document)
    z_up = document.release >= _ENU_SINCE
    if info is not None and "coordinateSystem" in info.fields:
        system = text(info, "coordinateSystem")
        if system not in _Z_UP:
            raise info.error(
                f"expected a coordinateSystem of {', '.join(_Z_UP)}, got {system!r}",
                "coordinateSystem",
            )
        z_up = _Z_UP[system]
    elif info is not None and not z_up and len(_items(info, "gravity")) == 3:
        # In old files gravity is a vector, which gives the vertical axis.
        x, y, z = numbers(info, "gravity", (0.0, -9.81, 0.0))
        z_up = -z > max(abs(x), abs(y))
    return world_frame(z_up, y_up_objects=document.release < _FLU_SINCE)


def _world_info(document: Document) -> WbtNode | None:
    return next((node for node in document.nodes if node.kind == "WorldInfo"), None)


def _items(node: WbtNode, name: str) -> tuple[object, ...]:
    return node.fields[name].items if name in node.fields else ()


def _time_step(info: WbtNode | None, found: WorldContent) -> float:
    step = _STEP if info is None else number(info, "basicTimeStep", _STEP)
    if step >= 0.001:
        return step
    found.notes.append(f"basicTimeStep {step:g} is replaced by {_STEP:g}, as in Webots")
    return _STEP


def _contacts(info: WbtNode | None) -> tuple[Contact, ...]:
    """The friction of each pair of materials that the file lists."""
    pairs = () if info is None else children(info, "contactProperties")
    return tuple(map(_contact, pairs))


def _contact(pair: WbtNode) -> Contact:
    one, other = (text(pair, f"material{k}", MATERIAL) for k in (1, 2))
    found = (*number_list(pair, "coulombFriction"), FRICTION)[0]
    finite = 0.0 <= found < INFINITE_FRICTION
    return Contact(one, other, found if finite else INFINITE_FRICTION)


def _driven_first(
    robots: list[EPuck], wanted: str | None, name: str
) -> tuple[EPuck, ...]:
    if wanted is None:
        return tuple(robots)
    chosen = [robot for robot in robots if robot.name == wanted]
    if not chosen:
        there = ", ".join(repr(robot.name) for robot in robots) or "none"
        raise WorldError(f"{name}: no e-puck named {wanted!r}; there are {there}")
    return (chosen[0], *(robot for robot in robots if robot is not chosen[0]))


def _notes(world: World, found: WorldContent) -> list[str]:
    """Assumptions that depend on the whole world."""
    notes = []
    if len(world.robots) > 1:
        names = ", ".join(repr(robot.name) for robot in world.robots[1:])
        notes.append(f"{world.robot.name!r} is driven; {names} stand still")
    if len(set(found.goals)) > 1:
        notes.append(f"{len(found.goals)} nodes are named GOAL; the first is used")
    floor = floor_under(world)
    if abs(floor) > _RAISED:
        notes.append(
            f"the robot stands {floor:.3g} m above the ground; falling off is not "
            "modelled"
        )
    for thing, fallen in zip(world.obstacles, bodies(world), strict=False):
        if fallen != thing:
            drop = thing.solid[0].top - fallen.solid[0].top
            name = thing.name or thing.kind
            notes.append(f"{name} floats {drop:.3g} m in the air; modelled as fallen")
    return notes
