"""The registry entry of TDAC-Map2D-v0."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from tdac_agent.tasks.environment import Environment, Names
from tdac_agent.tasks.setting import Nominal, Setting
from tdac_agent.tasks.units import PIXELS, Point
from tdac_envs.core.dynamics import ON_MAPS

if TYPE_CHECKING:
    from tdac_agent.builtin.template import Template
    from tdac_agent.environments.map2d.pictures import MapPictures
    from tdac_agent.environments.map2d.surroundings import MapSurroundings
    from tdac_agent.tasks.first_run import CodePart
    from tdac_agent.tasks.task import Task
    from tdac_agent.tasks.task_file import TaskFile
    from tdac_agent.verification.suite.oracle import Oracle
    from tdac_envs.map2d.env import Map2DEnv
    from tdac_envs.map2d.task import Map2DTask


class Map2DEnvironment(Environment):
    """Disc-shaped robots with range rays on maps, in px. See `Environment`."""

    id = "TDAC-Map2D-v0"
    folder = Path(__file__).parent
    units = PIXELS
    keys = (
        *("map", "robot", "movers", "snap", "frame"),
        *("polarity", "threshold", "resolution"),
    )
    names = Names(
        constants=(
            *("MAP_IMG", "PARAMS_JSON", "ROBOT_IMG", "AXLE_LENGTH_PX"),
            *("SENSOR_RANGE_PX", "SENSOR_FOV_DEG", "N_RAYS", "LOOKAHEAD"),
            *("STOP_DIST", "SLOW_DIST"),
        ),
        functions=("nearest_free", "plan_path", "run_episode", "main"),
        classes=("OccMap2D",),
    )
    kernels = "tdac_envs.map2d"
    code = ON_MAPS

    def bundled(self) -> dict[str, str]:
        """Returns the bundled maps; a task has the name of its map."""
        from tdac_envs.mapping.bundled import bundled_maps

        return {name: name for name in bundled_maps()}

    def open(self, spec: TaskFile, base: Path) -> tuple[str, Setting]:
        """See `open_map_task`."""
        from tdac_agent.environments.map2d.setting import open_map_task

        return open_map_task(spec, base)

    def small_env(self) -> Map2DEnv:
        """Returns an environment with an empty map of 60 x 40 px."""
        import numpy as np

        from tdac_envs.map2d.env import Map2DEnv

        cells = np.zeros((40, 60), np.bool_)
        return Map2DEnv(map=cells, start=(10, 10), goal=(50, 30), robot_radius=3)

    def code_parts(self, *, movers: bool, worlds: bool = False) -> list[CodePart]:
        """See `Environment`."""
        from tdac_agent.environments.map2d import kernels_used as used

        parts = [used.ROBOT]
        if movers:
            parts.append(used.MOVERS)
        if worlds:
            parts.append(used.WORLDS)
        return [*parts, used.PLANNERS] if movers and worlds else parts

    def use_kernels(self) -> None:
        """Reads a small map and drives on it."""
        from tdac_agent.environments.map2d.kernels_used import use_kernels

        use_kernels()

    def pictures(self, setting: Setting) -> MapPictures:
        """Returns an object that draws episodes on the map."""
        from tdac_agent.environments.map2d.pictures import MapPictures
        from tdac_agent.environments.map2d.setting import map_setting

        own = map_setting(setting)
        return MapPictures(own.nominal, own.robot_image, own.shown_in)

    def surroundings(self, task: Nominal) -> MapSurroundings:
        """Returns the map with the queries of a diagnosis."""
        from tdac_agent.environments.map2d.surroundings import MapSurroundings

        return MapSurroundings(_own(task))

    def oracle(self) -> Oracle:
        """Returns an oracle for grids."""
        from tdac_agent.verification.suite.oracle import Oracle

        return Oracle()

    def reference_path(self, task: Nominal, x: float, y: float) -> list[Point]:
        """See `Environment`."""
        from tdac_agent.environments.map2d.reference import reference_path

        return reference_path(_own(task), x, y)

    def privileged_facts(self, task: Nominal) -> dict[str, Any]:
        """See `Environment`."""
        own = _own(task)
        largest = max(own.terrain.grid.cells.shape)
        return {"largest": largest, "robot": own.robot, "dt": own.dt}

    def prompt_facts(self, task: Task) -> dict[str, Any]:
        """See `Environment`."""
        from tdac_agent.environments.map2d.prompt import facts_of

        return facts_of(task)

    def template(self, setting: Setting) -> Template[Any]:
        """See `template_for`."""
        from tdac_agent.environments.map2d.builtin import DEVIATIONS, template_for
        from tdac_agent.environments.map2d.setting import map_setting

        own = map_setting(setting)
        params = own.params
        resolution = params.resolution if params.frame == "metres" else None
        noise = own.length_of(own.disturbances.get("pose_noise", 0.0))
        kept = own.make_env().required_gap + DEVIATIONS * noise
        return template_for(params.robot, own.nominal.dt, resolution, kept)


def _own(task: Nominal) -> Map2DTask:
    from tdac_envs.map2d.task import Map2DTask

    assert isinstance(task, Map2DTask)
    return task


MAP2D = Map2DEnvironment()
