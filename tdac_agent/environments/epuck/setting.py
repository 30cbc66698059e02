"""Tasks in Webots worlds: opening them, and their part of the working folder."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from tdac_agent.environments.epuck.flat_world import flat_world
from tdac_agent.environments.epuck.moved_world import Motion
from tdac_agent.environments.epuck.params import WorldParams, params_of
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.tasks.setting import Original, Setting
from tdac_agent.tasks.task_file import TaskFile
from tdac_agent.tasks.units import METRES, Units
from tdac_envs.core.errors import TaskError
from tdac_envs.drawing.canvas import Image
from tdac_envs.drive.env import Observation
from tdac_envs.drive.task import with_tolerance_note
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.epuck.ground import Ground
from tdac_envs.epuck.infrared import TABLE
from tdac_envs.epuck.robot_options import e_puck_of, with_version
from tdac_envs.epuck.source import open_world
from tdac_envs.epuck.task import TOLERANCE, EPuckTask, make_task
from tdac_envs.robots.bundled import placed_robot
from tdac_envs.robots.robot_file import Body, RobotFile, body_in, body_written
from tdac_envs.worlds.bundled import bundled_worlds, world_file
from tdac_envs.worlds.wbt.reader import load_world
from tdac_envs.worlds.wbt.writer import write_world
from tdac_envs.worlds.world import Unmodelled, World, check_modelled

WORLD_FILE = "world.wbt"
_MEAN_NOISE = float(TABLE[:, 2].mean())


@dataclass(frozen=True, slots=True, eq=False)
class EPuckSetting:
    """A Webots world with a start and a goal.

    Attributes:
        params: Contents of `params.json`.
        nominal: The feasible task, in the flat world.
        text: The flat world file.
        file: The original world file.
        left_out: Descriptions of the ignored nodes that may be solid.
        disturbances: Errors of the robot that the task names, as arguments.
        stopping_distance: Of this robot, m; None without one.
        body: Of the robot, for another physics.
    """

    params: WorldParams
    nominal: EPuckTask
    text: str
    file: Path
    left_out: tuple[str, ...]
    disturbances: dict[str, Any] = field(default_factory=dict)
    stopping_distance: float | None = None
    body: Body | None = None

    @property
    def original(self) -> Original | None:
        """The original world file."""
        return Original(f"original{self.file.suffix}", self.file)

    @property
    def units(self) -> Units:
        """Metres."""
        return METRES

    @property
    def shown(self) -> Units:
        """Metres."""
        return METRES

    def in_metres(self) -> Setting:
        """Raises an error: worlds are always in metres."""
        raise TaskError("--metres is for maps; a world is in metres anyway")

    def without_movers(self) -> Setting:
        """Returns this task: nothing but the robot moves in a world."""
        return self

    def observed(self) -> EPuckEnv:
        """Constructs this task's environment."""
        return self.make_env()

    def seen(self, observation: Observation) -> Observation:
        """Returns the observation, which is in metres anyway."""
        return observation

    def length_text(self, length: float) -> str:
        """Formats a length in mm."""
        return METRES.figure(length)

    def remarks(self) -> list[str]:
        """Returns the floors and obstacles of the world."""
        world = self.nominal.ground.world
        kinds = Counter(t.kind for t in world.obstacles if t.solid)
        counted = [f"{count} {kind}" for kind, count in kinds.most_common()]
        floors = [arena.kind for arena in world.arenas]
        return [f"world {self.file.name}: {', '.join(floors + counted)}"]

    def env_kwargs(self) -> dict[str, Any]:
        """Returns the constructor arguments of this task's `EPuckEnv`."""
        nominal, stops = self.nominal, self.stopping_distance
        return {
            **({} if stops is None else {"stopping_distance": stops}),
            "world": nominal.ground.world,
            "start": tuple(nominal.start),
            "goal": nominal.goal,
            "goal_tolerance": nominal.goal_tolerance,
            "dt": nominal.dt,
            "horizon": nominal.horizon,
            "max_wheel_speed": nominal.max_wheel_speed,
        }

    def make_env(self, **options: Any) -> EPuckEnv:
        """Constructs this task's environment; `options` override its arguments."""
        if isinstance(options.get("physics"), str):
            own = {"engine": options["physics"], **body_in(self.body)}
            options = {**options, "physics": own}
        return EPuckEnv(**{**self.env_kwargs(), **options})

    def displaced(self, x: float, y: float) -> dict[str, Any]:
        """See `Setting`. Floors and their walls stay where they are."""
        world, shift = self.nominal.ground.world, Motion(0.0, x, y)
        moved = tuple(map(shift.obstacle, world.obstacles))
        return {"world": replace(world, obstacles=moved)}

    @property
    def has_metres(self) -> bool:
        """True: worlds are in metres."""
        return True

    def noise(self, relative: float) -> dict[str, float]:
        """Returns the option for the published noise, scaled to this mean."""
        return {"sensor_noise": relative / _MEAN_NOISE}

    @property
    def has_dropouts(self) -> bool:
        """False: infra-red sensors have no largest range."""
        return False

    def length_of(self, length: float) -> float:
        """Returns the length: both are in metres."""
        return length

    def facts(self) -> dict[str, Any]:
        """Returns the environment's arguments, with the world's hash and `left_out`."""
        own = {"world": self.world_sha256(), "left_out": self.left_out}
        return {**self.env_kwargs(), **own}

    def world_sha256(self) -> str:
        """Returns the hash of the flat world file."""
        return sha256_of(self.text)

    def write_files(self, folder: Path) -> None:
        """Writes `params.json` and `world.wbt`."""
        params = json.dumps(self.params.model_dump(mode="json"), indent=2)
        (folder / "params.json").write_text(f"{params}\n", encoding="utf-8")
        (folder / WORLD_FILE).write_text(self.text, encoding="utf-8")

    def preview(self) -> Image:
        """Draws the world from above."""
        from tdac_envs.worlds.picture import draw_world

        return draw_world(self.nominal.ground.world)

    def ends(self) -> dict[str, Any]:
        """See `Setting`."""
        nominal = self.nominal
        return {
            "start": [float(v) for v in nominal.start],
            "goal": [float(v) for v in nominal.goal],
            "tolerance": nominal.goal_tolerance,
        }

    def portable(self) -> dict[str, Any]:
        """Returns the keys for the flat world in the folder."""
        own: dict[str, Any] = {"world": WORLD_FILE}
        if self.left_out:
            own["left_out"] = list(self.left_out)
        robot: dict[str, Any] = body_written(self.body)
        if self.stopping_distance is not None:
            robot["stopping_distance"] = self.stopping_distance
        return own | ({"robot": robot} if robot else {})


def world_setting(setting: Setting) -> EPuckSetting:
    """Returns the setting, which must be an `EPuckSetting`."""
    if not isinstance(setting, EPuckSetting):
        raise TypeError(f"expected an EPuckSetting, got {type(setting).__name__}")
    return setting


def open_world_task(spec: TaskFile, base: Path) -> tuple[str, EPuckSetting]:
    """Returns the world's name, and the feasible task in it.

    Args:
        spec: Contents of the task file.
        base: Folder that relative paths refer to.

    Raises:
        WorldError: The world cannot be read, or has nodes that are not modelled.
        TaskError: The task is infeasible, or start or goal is missing.
    """
    bundled = spec.world in bundled_worlds()
    file = world_file(spec.world if bundled else str(base / spec.world))
    world = load_world(file)
    ignored = check_modelled(world, spec.ignore)
    if spec.goal is None and world.goal is None:
        raise TaskError(
            f"{world.source} names no goal: give --goal X Y in metres (`goal: [X, Y]` "
            "in a task.yaml)"
        )
    if spec.start is None and not world.robots:
        raise TaskError(
            f"{world.source} has no e-puck in it: give --start X Y YAW in metres and "
            "rad (`start: [X, Y, YAW]` in a task.yaml)"
        )
    left_out = spec.left_out or tuple(map(_describe, ignored))
    name = spec.robot.file
    robot = None if name is None else e_puck_of(placed_robot(name, base))
    setting = _setting(world, file, spec, left_out, robot)
    return file.stem, setting


def _setting(
    world: World,
    file: Path,
    spec: TaskFile,
    left_out: tuple[str, ...],
    robot: RobotFile | None,
) -> EPuckSetting:
    dt = world.time_step / 1e3 if spec.dt is None else spec.dt
    opened = open_world(world, spec.start, spec.goal, spec.ignore)
    stops, body = spec.robot.stopping_distance, spec.robot.body
    if robot is not None:
        opened = with_version(opened, robot)
        stops = robot.stopping_distance if stops is None else stops
        body = robot.body if body is None else body
    flat = flat_world(opened, dt)
    assert flat.goal is not None
    nominal = make_task(
        Ground.of(flat),
        flat.robot.pose,
        flat.goal,
        max_wheel_speed=flat.robot.max_wheel_speed,
        dt=dt,
        goal_tolerance=TOLERANCE if spec.tolerance is None else spec.tolerance,
        horizon=spec.horizon,
    )
    text = write_world(flat)
    digest = sha256_of(text)
    notes = with_tolerance_note(world.notes, nominal, METRES.length_text)
    params = params_of(nominal, file.name, digest, notes)
    errors = {} if robot is None else robot.disturbances()
    return EPuckSetting(params, nominal, text, file, left_out, errors, stops, body)


def _describe(node: Unmodelled) -> str:
    name = f"{node.kind} {node.name!r}" if node.name else node.kind
    return f"{name} at ({node.x:g}, {node.y:g})"
