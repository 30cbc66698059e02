"""Tasks on maps: opening them, and their part of the working folder."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from tdac_agent.environments.map2d.moving import as_option, check_movers
from tdac_agent.environments.map2d.task_robot import (
    check_robot_image,
    further,
    further_written,
    robot_in_pixels,
    robot_text,
    with_robot,
    with_robot_file,
)
from tdac_agent.tasks.setting import Original, Setting
from tdac_agent.tasks.task_file import TaskFile, check_frame
from tdac_agent.tasks.units import PIXELS, Units
from tdac_envs.core.errors import RefusedError, TaskError
from tdac_envs.drawing.canvas import Image
from tdac_envs.drive.env import Observation
from tdac_envs.drive.task import Pose, with_tolerance_note
from tdac_envs.grid.grid import OccupancyGrid
from tdac_envs.grid.map_units import PIXELS as MAP_PIXELS
from tdac_envs.grid.map_units import MapUnits
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.map2d.metric_input import movers_in, movers_in_pixels
from tdac_envs.map2d.metric_view import MetricView
from tdac_envs.map2d.picture import ROBOT_IMAGE
from tdac_envs.map2d.source import prepare, units_of
from tdac_envs.map2d.task import Map2DTask, Terrain, make_task
from tdac_envs.mapping.bundled import bundled_maps
from tdac_envs.mapping.fault import fault_of
from tdac_envs.mapping.image import read_bytes
from tdac_envs.mapping.map_folder import preview_of, write_grid
from tdac_envs.mapping.params import MapParams, ReadingOptions
from tdac_envs.mapping.preprocessing import as_image
from tdac_envs.mapping.wording import (
    obstacles_text,
    scale_hint,
    scale_text,
    with_hints,
)
from tdac_envs.movers.spec import AnySpec
from tdac_envs.robots.robot_file import Body, body_in, body_written

DT = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Map2DSetting:
    """A map with a start, a goal and a robot.

    Attributes:
        params: Contents of `params.json`, with start, goal and robot.
        nominal: The feasible task.
        image: Map image, or None.
        robot_image: Picture of the robot.
        movers: Moving obstacles, px.
        view: What a controller observes, if it is told metres.
        disturbances: What its file says of the robot's, in units of the task.
        shown_in: Units of what the user reads; the environment's units are pixels.
        body: Of the robot, for another physics.
    """

    params: MapParams
    nominal: Map2DTask
    image: Path | None
    robot_image: Path
    movers: tuple[AnySpec, ...] = ()
    shown_in: MapUnits = MAP_PIXELS
    view: MetricView | None = None
    disturbances: dict[str, Any] = field(default_factory=dict)
    body: Body | None = None

    @property
    def original(self) -> Original | None:
        """The map image."""
        if self.image is None:
            return None
        return Original(f"map{self.image.suffix}", self.image)

    @property
    def units(self) -> Units:
        """Pixels."""
        return PIXELS

    @property
    def shown(self) -> Units:
        """Pixels, printed as in `shown_in`."""
        if self.shown_in == MAP_PIXELS:
            return PIXELS
        return PIXELS.in_metres(self.shown_in)

    def in_metres(self) -> Map2DSetting:
        """See `Setting`."""
        if self.params.resolution is None:
            raise TaskError(
                f"--metres needs a map with a resolution, as in map.yaml; "
                f"{self.params.source} has none"
            )
        return replace(self, shown_in=MapUnits.metres(self.params))

    def without_movers(self) -> Map2DSetting:
        """See `Setting`."""
        return replace(self, movers=())

    def observed(self) -> Map2DEnv:
        """See `Setting`."""
        env = self.make_env()
        if self.view is None:
            return env
        return Map2DEnv.of(replace(env.setup, metric=self.task_units.frame))

    def seen(self, observation: Observation) -> Observation:
        """See `Setting`."""
        return observation if self.view is None else self.view.seen(observation)

    def length_text(self, length: float) -> str:
        """Formats a length in `shown_in`."""
        return self.shown.figure(length)

    @property
    def left_out(self) -> tuple[str, ...]:
        """Empty: a map has no nodes."""
        return ()

    def remarks(self) -> list[str]:
        """Returns how the image was read."""
        params = self.params
        if params.method == "given":
            return []
        scale = scale_text(params.resolution)
        lines = [f"map: {obstacles_text(params)}; {scale}"]
        if self.shown_in != MAP_PIXELS:
            note = "" if self.view else "; the controller and its tests use px"
            lines.append(f"metres of the map's frame{note}")
            lines.append(robot_text(params.robot, self.shown_in))
        return lines

    def env_kwargs(self) -> dict[str, Any]:
        """Returns the constructor arguments of this task's `Map2DEnv`."""
        nominal, robot = self.nominal, self.nominal.robot
        return {
            **as_option(self.movers),
            **further(robot),
            "map": nominal.terrain.grid.cells,
            "start": tuple(nominal.start),
            "goal": nominal.goal,
            "robot_radius": robot.radius,
            "axle_length": robot.axle_length,
            "max_wheel_speed": robot.max_wheel_speed,
            "n_rays": robot.n_rays,
            "field_of_view": robot.field_of_view_deg,
            "range_max": robot.range_max,
            "dt": nominal.dt,
            "horizon": nominal.horizon,
            "goal_tolerance": nominal.goal_tolerance,
        }

    def make_env(self, **options: Any) -> Map2DEnv:
        """Constructs this task's environment; `options` override its arguments."""
        if isinstance(options.get("physics"), str):
            own = {"resolution": self.params.resolution, **body_in(self.body)}
            options = {**options, "physics": {"engine": options["physics"], **own}}
        return Map2DEnv(**{**self.env_kwargs(), **options})

    def displaced(self, x: float, y: float) -> dict[str, Any]:
        """See `Setting`. The map moves by whole pixels; what enters it is occupied."""
        cells = self.nominal.terrain.grid.cells
        by = round(y), round(x)
        moved = np.roll(cells, by, (0, 1))
        rows, columns = (slice(n) if n > 0 else slice(n, None) for n in by)
        if by[0]:
            moved[rows] = True
        if by[1]:
            moved[:, columns] = True
        return {"map": moved}

    @property
    def has_metres(self) -> bool:
        """Whether the map has a resolution."""
        return self.params.resolution is not None

    def noise(self, relative: float) -> dict[str, float]:
        """Returns the option for this relative noise of each range."""
        return {"range_noise": relative}

    @property
    def has_dropouts(self) -> bool:
        """True: rays may read the largest range."""
        return True

    def length_of(self, length: float) -> float:
        """See `Setting`."""
        return self.task_units.length_in_pixels(length)

    def facts(self) -> dict[str, Any]:
        """Returns the environment's arguments, with the map's hash."""
        frame = {} if self.view is None else {"frame": self.params.frame}
        return {**self.env_kwargs(), "map": self.world_sha256(), **frame}

    def world_sha256(self) -> str:
        """Returns the hash of the grid."""
        return self.nominal.terrain.grid.sha256()

    def write_files(self, folder: Path) -> None:
        """Writes `params.json`, `occupancy.npy`, `occupancy.png` and `robot.png`."""
        write_grid(folder, self.nominal.terrain.grid, self.params)
        (folder / "robot.png").write_bytes(read_bytes(self.robot_image))

    def preview(self) -> Image:
        """Draws the map image with free space, start, goal and path."""
        grid = self.nominal.terrain.grid
        shown = grid.cells if self.image is None else self.image
        path = self.nominal.shortest_path(self.nominal.start)
        image = as_image(shown)
        near = self.nominal.goal_tolerance
        return preview_of(
            image, grid, self.params, self.shown_in, path=path, tolerance=near
        )

    def portable(self) -> dict[str, Any]:
        """Returns the keys for the grid and robot picture in the folder."""
        robot, units = self.nominal.robot, self.task_units
        length = units.written_length
        return {
            **as_option(movers_in(units, self.movers)),
            **({} if self.view is None else {"frame": self.params.frame}),
            "map": ".",
            "robot": {
                **further_written(robot, units),
                "radius": length(robot.radius),
                "axle": length(robot.axle_length),
                "max_wheel_speed": length(robot.max_wheel_speed),
                "n_rays": robot.n_rays,
                "field_of_view": robot.field_of_view_deg,
                "range_max": length(robot.range_max),
                **body_written(self.body),
                "image": "robot.png",
            },
        }

    def ends(self) -> dict[str, Any]:
        """See `Setting`."""
        nominal, units = self.nominal, self.task_units
        x, y, heading = nominal.start
        return {
            "start": [*units.written_place(x, y), units.heading(heading)],
            "goal": [*units.written_place(*nominal.goal)],
            "tolerance": units.written_length(nominal.goal_tolerance),
        }

    @property
    def task_units(self) -> MapUnits:
        """Units of a task file and of what a controller observes."""
        return MAP_PIXELS if self.view is None else MapUnits.metres(self.params)


def map_setting(setting: Setting) -> Map2DSetting:
    """Returns the setting, which must be a `Map2DSetting`."""
    if not isinstance(setting, Map2DSetting):
        raise TypeError(f"expected a Map2DSetting, got {type(setting).__name__}")
    return setting


def open_map_task(spec: TaskFile, base: Path) -> tuple[str, Map2DSetting]:
    """Returns the map's name, and the feasible task on it.

    Args:
        spec: Contents of the task file.
        base: Folder that relative paths refer to.

    Raises:
        MapError: The map cannot be used.
        TaskError: The task is infeasible, or the robot's picture cannot be used.
    """
    bundled = spec.map in bundled_maps()
    source = spec.map if bundled else str(base / spec.map)
    check_frame(spec.frame, spec.profile)
    typed = None if spec.start is None else (spec.start[0], spec.start[1])
    units = units_of(source, spec.frame, spec.resolution).with_typed(typed, spec.goal)
    spec = _in_pixels(spec, units)
    spec, disturbances = with_robot_file(spec, source, base, units)
    prepared = prepare(
        source,
        spec.start,
        spec.goal,
        robot_radius=spec.robot.radius,
        snap=spec.snap,
        options=ReadingOptions(spec.polarity, spec.threshold),
        resolution=spec.resolution,
        units=units,
    )
    params = with_robot(prepared.params, spec.robot)
    params = params.model_copy(update={"frame": spec.frame})
    try:
        nominal = _feasible(prepared.grid, params, spec, units)
    except TaskError as error:
        if fault_of(prepared.grid.cells, params, units) is None:
            raise
        image = as_image(prepared.image or prepared.grid.cells)
        picture = (image, prepared.grid, params, units)
        reason = with_hints(str(error), prepared.grid, params, units)
        message = f"{params.source}: {reason}"
        pictures = {"refused": picture}
        raise RefusedError(message, params.source, pictures) from error
    check_movers(spec.movers, nominal)
    notes = with_tolerance_note(params.notes, nominal, units.length)
    hint = scale_hint(params.robot.radius, prepared.grid.resolution)
    notes = (*notes, hint) if hint and hint not in notes else notes
    params = params.model_copy(update={"notes": notes})
    robot_image = ROBOT_IMAGE if spec.robot.image is None else base / spec.robot.image
    if not robot_image.is_file():
        raise TaskError(f"no robot image {str(robot_image)!r}: no such file")
    if spec.robot.image is not None:
        check_robot_image(robot_image)
    name = spec.map if bundled else Path(spec.map).stem
    setting = Map2DSetting(
        params,
        nominal,
        prepared.image,
        robot_image,
        spec.movers,
        units,
        None if units.frame is None else MetricView(units.frame),
        disturbances,
        spec.robot.body,
    )
    return name, setting


def _in_pixels(spec: TaskFile, units: MapUnits) -> TaskFile:
    """The task file with its places and lengths converted to px."""
    if spec.frame == "pixels":
        return spec
    changes: dict[str, Any] = {}
    if spec.start is not None:
        place = units.pixels((spec.start[0], spec.start[1]))
        turn = [units.heading_in_pixels(heading) for heading in spec.start[2:]]
        changes["start"] = (*place, *turn)
    if spec.goal is not None:
        changes["goal"] = units.pixels(spec.goal)
    if spec.tolerance is not None:
        changes["tolerance"] = units.length_in_pixels(spec.tolerance)
    changes["robot"] = robot_in_pixels(spec.robot, units)
    changes["movers"] = movers_in_pixels(spec.movers, units)
    return spec.model_copy(update=changes)


def _feasible(
    grid: OccupancyGrid, params: MapParams, spec: TaskFile, units: MapUnits
) -> Map2DTask:
    assert params.start is not None
    assert params.goal is not None
    return make_task(
        Terrain.of(grid),
        Pose(*params.start, params.heading),
        params.goal,
        params.robot,
        dt=DT if spec.dt is None else spec.dt,
        goal_tolerance=spec.tolerance,
        horizon=spec.horizon,
        units=units,
    )
