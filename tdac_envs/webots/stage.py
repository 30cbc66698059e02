"""A world file prepared for a controller: environment, scene and devices."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tdac_envs.core.arguments import finite_point
from tdac_envs.core.errors import WorldError
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.epuck.ground import Ground
from tdac_envs.epuck.paths import field_to, open_field, path_entry
from tdac_envs.epuck.source import with_start
from tdac_envs.webots.cameras import CameraFacts, find_cameras
from tdac_envs.webots.coordinates import FileFrame, Found, walk_frames
from tdac_envs.webots.devices import DeviceFacts, find_devices
from tdac_envs.webots.floors import find_floors
from tdac_envs.webots.instruments import Instruments, find_instruments
from tdac_envs.webots.lights import find_lights
from tdac_envs.webots.missing import missing_devices
from tdac_envs.webots.mounts import mounts
from tdac_envs.webots.movable import Movable, find_movables
from tdac_envs.webots.reach import (
    beside_obstacles,
    why_unreachable,
    without_far_nodes,
)
from tdac_envs.webots.scanners import ScannerFacts, find_scanners
from tdac_envs.webots.scene import NodeTable
from tdac_envs.webots.views import Viewer
from tdac_envs.worlds.bodies import BODY_RADIUS
from tdac_envs.worlds.wbt.colours import BLACK_SKY, Sky, sky_of
from tdac_envs.worlds.wbt.fields import flag, text
from tdac_envs.worlds.wbt.frames import NodeFrame
from tdac_envs.worlds.wbt.protofiles import ProtoFolder
from tdac_envs.worlds.wbt.reader import frame_of, read_text, read_world, with_goal
from tdac_envs.worlds.wbt.robots import is_epuck
from tdac_envs.worlds.wbt.tree import WbtNode, parse
from tdac_envs.worlds.wbt.unknown import unknown_fields
from tdac_envs.worlds.world import World, check_modelled


@dataclass(frozen=True, slots=True, eq=False)
class ControllerWorld:
    """A world in which a controller runs.

    Attributes:
        name: File name.
        text: Content of the file.
        world: World, always with a goal; see `has_goal`.
        is_moved: Whether the robot starts elsewhere than in the file.
        has_goal: Whether a goal is given; else that of `world` is a placeholder, the
            farthest reachable point.
        left_out: Names or types of unmodelled nodes that are left out.
        notes: What was changed or assumed so that the world can be used.
        scene: Nodes of the file.
        robot: Node of the robot.
        frame: Conversion of the robot's pose to the file's coordinates.
        movables: Objects that can be pushed, in the environment's order.
        devices: Modelled devices of the robot.
        absent: Names of the devices that are not modelled.
        instruments: Distance and light sensors beside ps0 to ps7.
        cameras: Cameras of the robot.
        scanners: Lidars and range finders of the robot.
        sky: What cameras see beyond the world.
    """

    name: str
    text: str
    world: World
    is_moved: bool
    has_goal: bool
    left_out: tuple[str, ...]
    notes: tuple[str, ...]
    scene: NodeTable
    robot: WbtNode
    frame: FileFrame
    movables: tuple[Movable | None, ...]
    devices: tuple[DeviceFacts, ...]
    absent: tuple[str, ...]
    instruments: Instruments
    cameras: tuple[CameraFacts, ...] = ()
    scanners: tuple[ScannerFacts, ...] = ()
    sky: Sky = BLACK_SKY

    @property
    def is_supervisor(self) -> bool:
        """Whether the robot is a supervisor, which may query the world."""
        return flag(self.robot, "supervisor", False)

    @property
    def viewers(self) -> tuple[Viewer, ...]:
        """The devices that see the scenery."""
        return (*self.cameras, *self.scanners)

    def facts(self) -> dict[str, Any]:
        """The facts that the `controller` package receives at the start."""
        number = self.scene.number(self.robot)
        nodes = [node.plain() for node in self.scene.nodes]
        return {
            "name": text(self.robot, "name", "e-puck"),
            "model": text(self.robot, "model", "GCtronic e-puck"),
            "node_type": 34,
            "basic_time_step": self.world.time_step,
            "supervisor": self.is_supervisor,
            "synchronization": flag(self.robot, "synchronization", True),
            "custom_data": text(self.robot, "customData"),
            "devices": [device.plain() for device in self.devices],
            "not_modelled": list(self.absent),
            "self": number,
            "scene": nodes if self.is_supervisor else nodes[:1],
        }

    def arguments(self) -> tuple[str, ...]:
        """The robot's `controllerArgs`."""
        if "controllerArgs" not in self.robot.fields:
            return ()
        items = self.robot.fields["controllerArgs"].items
        return tuple(item for item in items if isinstance(item, str))

    def make_env(
        self, *, steps: int | None = None, webots_sensors: bool = False, **options: Any
    ) -> EPuckEnv:
        """Makes the environment; contacts are counted and do not end the run.

        Args:
            steps: Horizon, steps; by default that of the environment.
            webots_sensors: Use Webots' noise and materials, and show the goal marker.
            options: Further options of `EPuckEnv`.
        """
        sensors: dict[str, Any] = {}
        if webots_sensors:
            sensors = {
                "sensor_noise": 1.0,
                "reflectance": "webots",
                "goal_visible": True,
            }
        env = EPuckEnv(
            self.world,
            horizon=steps,
            on_collision="block",
            ignore=self.left_out,
            **sensors,
            **options,
        )
        env.ends = self.has_goal
        return env


def open_stage(
    path: Path,
    goal: Sequence[float] | None = None,
    ignore: Iterable[str] = (),
    start: Sequence[float] | None = None,
    controller: str = "",
) -> ControllerWorld:
    """Reads a world file for a controller.

    Args:
        path: The `.wbt` file.
        goal: (x, y), m; by default the file's, if it has one.
        ignore: Names or types of unmodelled nodes to leave out.
        start: (x, y) or (x, y, heading), m and rad; by default the file's.
        controller: Name of the controller; of several e-pucks, the first one that has
            this controller in the file is driven, else the first of all.

    Raises:
        WorldError: The world cannot be used.
        TaskError: Start or goal is invalid.
    """
    content = read_text(path)
    world = read_world(content, path.name, folder=path.parent)
    if not world.robots:
        raise WorldError(f"{path.name}: there is no e-puck in it")
    names = tuple(ignore)
    world, chosen = _driven_by(controller, world)
    world, notes = without_far_nodes(world)
    notes = (*chosen, *notes)
    check_modelled(world, names)
    if goal is not None:
        world = with_goal(world, finite_point("goal", goal))
    in_file = world.robot
    if start is not None:
        world = with_start(world, start)
    else:
        world, moved = beside_obstacles(world)
        notes += moved
    has_goal = world.goal is not None
    why = why_unreachable(world) if has_goal and not (goal or start) else None
    if why is not None:
        notes += (f"the file's GOAL is not used: {why}",)
        marks = tuple(replace(thing, is_goal=False) for thing in world.obstacles)
        world, has_goal = replace(world, goal=None, obstacles=marks), False
    if not has_goal:
        world = replace(world, goal=_farthest(world))
    document = parse(content, path.name)
    top = frame_of(document)
    robot, own = _find_robot(document.nodes, top, path.name, controller)
    mounted = tuple(mounts(robot, own, in_file))
    protos = ProtoFolder(path.parent, document.version)
    all_nodes = protos.expanded(document).nodes
    notes += tuple(unknown_fields(document, protos.fields()))
    floors = find_floors(all_nodes, top, path.parent)
    lights = find_lights(document.nodes, top)
    instruments = find_instruments(robot, mounted, lights, floors)
    notes += instruments.notes()
    cameras, too_large = find_cameras(robot, own, mounted)
    scanners = find_scanners(mounted)
    limit = world.robot.max_wheel_speed
    devices, absent = find_devices(limit, mounted, instruments, cameras, scanners)
    absent = tuple(dict.fromkeys((*absent, *too_large)))
    notes += tuple(missing_devices(absent, mounted))
    frame = FileFrame.of(top, own, in_file.heading)
    scene = NodeTable(document.nodes)
    return ControllerWorld(
        name=path.name,
        text=content,
        world=world,
        is_moved=start is not None,
        has_goal=has_goal,
        left_out=names,
        notes=notes,
        scene=scene,
        robot=robot,
        frame=frame,
        movables=find_movables(Ground.of(world), document.nodes, top),
        devices=devices,
        absent=absent,
        instruments=instruments,
        cameras=cameras,
        scanners=scanners,
        sky=sky_of(document.nodes),
    )


def _driven_by(controller: str, world: World) -> tuple[World, tuple[str, ...]]:
    """The world with the e-puck first that has a controller, and a note about it."""
    own = [robot for robot in world.robots if robot.controller == controller]
    if not own or own[0] is world.robot:
        return world, ()
    others = (robot for robot in world.robots if robot is not own[0])
    note = (
        f"of {len(world.robots)} e-pucks, {own[0].name!r} is driven: it has the "
        f"controller {controller!r}"
    )
    return replace(world, robots=(own[0], *others)), (note,)


def _find_robot(
    nodes: Iterable[WbtNode], top: NodeFrame, name: str, controller: str
) -> Found:
    """The e-puck of `_driven_by` and its frame, in the order of the reader."""
    found = [pair for pair in walk_frames(nodes, top) if is_epuck(pair[0])]
    own = [pair for pair in found if text(pair[0], "controller") == controller]
    for pair in own or found:
        return pair
    raise WorldError(
        f"{name}: the e-puck must be at the top level or in a Group, Pose or Solid"
    )


def _farthest(world: World) -> tuple[float, float]:
    """The reachable point farthest from the robot; its position if there is none."""
    ground = Ground.of(world)
    free = open_field(ground.free(BODY_RADIUS))
    begin = path_entry(ground, free, world.robot.pose[:2])
    if begin is None:
        return world.robot.pose[:2]
    field = field_to(ground, begin)
    away = np.where(np.isfinite(field), field, -1.0)
    row, column = divmod(int(away.argmax()), away.shape[1])
    return ground.at(column, row)
