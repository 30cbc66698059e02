"""The feasible task that a `task.yaml` stands for, and the files it comes with."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import yaml

from tdac_agent.task_file import RobotSpec, TaskFile, read_task_file
from tdac_envs.errors import TaskError
from tdac_envs.grid import OccupancyGrid
from tdac_envs.map2d import Map2DEnv
from tdac_envs.map_folder import write_grid
from tdac_envs.maps import bundled_maps
from tdac_envs.params import MapParams, RobotParams
from tdac_envs.render import ROBOT_IMAGE
from tdac_envs.source2d import prepare
from tdac_envs.task2d import Map2DTask, Pose, Terrain, make_task

SENSORS_FILE = Path(__file__).parent.parent / "tdac_envs" / "sensors.py"
MIN_PROGRESS_STEPS = 400


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """A task that was checked and found feasible.

    Attributes:
        name: For people.
        spec: The file's contents.
        params: Of the map, start, goal and robot filled in.
        nominal: The feasible task.
        image: Map image, where there is one.
        robot_image: Picture of the robot.
        suite: Folder with further test files, where there is one.
    """

    name: str
    spec: TaskFile
    params: MapParams
    nominal: Map2DTask
    image: Path | None
    robot_image: Path
    suite: Path | None = None

    @property
    def progress_steps(self) -> int:
        """Steps within which the progress test wants its progress."""
        default = max(MIN_PROGRESS_STEPS, math.ceil(0.16 * self.nominal.horizon))
        return self.spec.progress.steps or default

    def env_kwargs(self) -> dict[str, Any]:
        """Arguments that make this task's environment; see `Map2DEnv`."""
        nominal, robot = self.nominal, self.nominal.robot
        return {
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
        """The environment of this task; options as for `Map2DEnv`."""
        return Map2DEnv(**{**self.env_kwargs(), **options})

    def sha256(self) -> str:
        """Hash of everything that decides an episode."""
        facts = {k: v for k, v in self.env_kwargs().items() if k != "map"}
        facts["map"] = self.nominal.terrain.grid.sha256()
        facts["progress"] = self.spec.progress.model_dump()
        text = json.dumps(facts, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()


def load_task(source: str | Path | TaskFile, *, base: Path | None = None) -> Task:
    """Reads and checks a task.

    Args:
        source: Name of a bundled task, path of a `task.yaml`, folder that holds
            one, or its contents.
        base: Folder that relative paths in the contents refer to; the file's own
            by default.

    Raises:
        TaskError: The file or the task cannot be used; the message says what to do.
        MapError: The map cannot be used.
    """
    name = "task"
    if isinstance(source, TaskFile):
        spec = source
    elif str(source) in bundled_maps():
        name, spec = str(source), TaskFile(map=str(source))
    else:
        path = Path(source)
        path = path / "task.yaml" if path.is_dir() else path
        spec, base = read_task_file(path, source), base or path.parent
        name = path.parent.resolve().name if path.name == "task.yaml" else path.stem
    return _resolve(name, spec, base or Path())


def _resolve(name: str, spec: TaskFile, base: Path) -> Task:
    if spec.map in bundled_maps():
        source, name = spec.map, spec.map if name == "task" else name
    else:
        source = str(base / spec.map)
        name = Path(spec.map).stem if name == "task" else name
    prepared = prepare(
        source,
        spec.start,
        spec.goal,
        robot_radius=spec.robot.radius,
        snap=spec.snap,
    )
    params = _with_robot(prepared.params, spec.robot)
    nominal = _feasible(prepared.grid, params, spec)
    robot_image = ROBOT_IMAGE if spec.robot.image is None else base / spec.robot.image
    if not robot_image.is_file():
        raise TaskError(f"no robot image {str(robot_image)!r}: no such file")
    if not cv2.haveImageReader(str(robot_image)):
        raise TaskError(f"the robot image {str(robot_image)!r} is not a PNG or JPEG")
    suite = None if spec.suite is None else base / spec.suite
    name = spec.name or name
    return Task(name, spec, params, nominal, prepared.image, robot_image, suite)


def _with_robot(params: MapParams, spec: RobotSpec) -> MapParams:
    given = spec.model_dump(exclude={"radius", "image"}, exclude_none=True)
    fields = {"axle": "axle_length", "field_of_view": "field_of_view_deg"}
    changes = {fields.get(key, key): value for key, value in given.items()}
    robot = RobotParams(**{**params.robot.model_dump(), **changes})
    return params.model_copy(update={"robot": robot})


def _feasible(grid: OccupancyGrid, params: MapParams, spec: TaskFile) -> Map2DTask:
    assert params.start is not None
    assert params.goal is not None
    return make_task(
        Terrain.of(grid),
        Pose(*params.start, params.heading),
        params.goal,
        params.robot,
        dt=spec.dt,
        goal_tolerance=spec.tolerance,
        horizon=spec.horizon,
    )


def write_workdir(folder: Path, task: Task) -> None:
    """Fills the folder a controller works in.

    Writes `params.json`, `occupancy.npy`, `occupancy.png`, `robot.png` and
    `sensors.py`; the controller itself comes beside them.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_grid(folder, task.nominal.terrain.grid, task.params)
    (folder / "robot.png").write_bytes(task.robot_image.read_bytes())
    (folder / "sensors.py").write_bytes(SENSORS_FILE.read_bytes())


def portable_task_file(task: Task, own_suite: str | None = None) -> str:
    """`task.yaml` for a run folder: the map is the folder's own grid.

    Args:
        task: Any.
        own_suite: Name of the subfolder that holds the task's suite, if it has one.
    """
    robot = task.nominal.robot
    spec = task.spec.model_dump(
        mode="json", exclude_none=True, exclude={"snap", "suite"}, by_alias=True
    )
    spec["name"] = task.name
    spec["map"] = "."
    if task.suite is not None and own_suite is not None:
        spec["suite"] = own_suite
    spec["start"] = [float(v) for v in task.nominal.start]
    spec["goal"] = [float(v) for v in task.nominal.goal]
    spec["tolerance"] = task.nominal.goal_tolerance
    spec["horizon"] = task.nominal.horizon
    spec["robot"] = {
        "radius": robot.radius,
        "axle": robot.axle_length,
        "max_wheel_speed": robot.max_wheel_speed,
        "n_rays": robot.n_rays,
        "field_of_view": robot.field_of_view_deg,
        "range_max": robot.range_max,
        "image": "robot.png",
    }
    return yaml.safe_dump(spec, sort_keys=False)
