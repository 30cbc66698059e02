"""The registry entry of TDAC-EPuck-v0."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from tdac_agent.tasks.environment import Environment, Names
from tdac_agent.tasks.setting import Nominal, Setting
from tdac_agent.tasks.units import METRES, Point
from tdac_envs.core.dynamics import IN_WORLDS

if TYPE_CHECKING:
    from tdac_agent.builtin.template import Template
    from tdac_agent.environments.epuck.oracle import WorldOracle
    from tdac_agent.environments.epuck.pictures import WorldPictures
    from tdac_agent.environments.epuck.surroundings import WorldSurroundings
    from tdac_agent.tasks.first_run import CodePart
    from tdac_agent.tasks.task import Task
    from tdac_agent.tasks.task_file import TaskFile
    from tdac_envs.epuck.env import EPuckEnv
    from tdac_envs.epuck.task import EPuckTask


class EPuckEnvironment(Environment):
    """E-pucks in Webots worlds, in m. See `Environment`."""

    id = "TDAC-EPuck-v0"
    folder = Path(__file__).parent
    units = METRES
    keys = ("world", "robot", "ignore", "left_out")
    robot_keys = frozenset({"file", "stopping_distance", "body"})
    names = Names(
        constants=(
            *("WORLD_FILE", "TIME_STEP", "MAX_WHEEL_SPEED", "SENSOR_RANGE"),
            "GOAL_TOLERANCE",
        ),
        functions=(
            *("parse_world", "build_grid", "astar", "compute_wheel_speeds"),
            *("run_episode", "main"),
        ),
    )
    kernels = "tdac_envs.epuck"
    code = IN_WORLDS

    def bundled(self) -> dict[str, str]:
        """Returns the bundled worlds: `epuck` is `arena`, `epuck-maze` is `maze`."""
        from tdac_envs.worlds.bundled import bundled_worlds

        default, *others = bundled_worlds()
        return {"epuck": default, **{f"epuck-{name}": name for name in others}}

    def open(self, spec: TaskFile, base: Path) -> tuple[str, Setting]:
        """See `open_world_task`."""
        from tdac_agent.environments.epuck.setting import open_world_task

        return open_world_task(spec, base)

    def small_env(self) -> EPuckEnv:
        """Returns an environment with the default bundled world."""
        from tdac_envs.epuck.env import EPuckEnv

        return EPuckEnv()

    def code_parts(
        self,
        *,
        movers: bool,  # noqa: ARG002 - e-pucks have none
        worlds: bool = False,  # noqa: ARG002 - their worlds need no code of their own
    ) -> list[CodePart]:
        """See `Environment`."""
        from tdac_agent.environments.epuck.kernels_used import ROBOT

        return [ROBOT]

    def use_kernels(self) -> None:
        """Drives in a bundled world."""
        from tdac_agent.environments.epuck.kernels_used import use_kernels

        use_kernels()

    def pictures(self, setting: Setting) -> WorldPictures:
        """Returns an object that draws episodes in the world."""
        from tdac_agent.environments.epuck.pictures import WorldPictures
        from tdac_agent.environments.epuck.setting import world_setting

        return WorldPictures(world_setting(setting).nominal)

    def surroundings(self, task: Nominal) -> WorldSurroundings:
        """Returns the world with the queries of a diagnosis."""
        from tdac_agent.environments.epuck.surroundings import WorldSurroundings

        return WorldSurroundings(_own(task))

    def oracle(self) -> WorldOracle:
        """Returns an oracle for grids and worlds."""
        from tdac_agent.environments.epuck.oracle import WorldOracle

        return WorldOracle()

    def reference_path(self, task: Nominal, x: float, y: float) -> list[Point]:
        """See `Environment`."""
        from tdac_agent.environments.epuck.reference import reference_path

        return reference_path(_own(task), x, y)

    def privileged_facts(self, task: Nominal) -> dict[str, Any]:
        """See `Environment`."""
        from tdac_agent.verification.suite.contract import time_step
        from tdac_envs.epuck.kernels import WHEEL_RADIUS

        own = _own(task)
        return {
            "largest": max(map(abs, own.ground.bounds)),
            "time_step": time_step(own.dt),
            "wheel_radius": WHEEL_RADIUS,
            "axle_length": own.axle_length,
            "max_wheel_speed": own.max_wheel_speed,
            "goal_tolerance": own.goal_tolerance,
        }

    def prompt_facts(self, task: Task) -> dict[str, Any]:
        """See `Environment`."""
        from tdac_agent.environments.epuck.prompt import facts_of

        return facts_of(task)

    def template(self, setting: Setting) -> Template[Any]:
        """See `template_for`."""
        from tdac_agent.environments.epuck.builtin import template_for
        from tdac_agent.environments.epuck.setting import world_setting

        kept = setting.make_env().required_gap
        return template_for(world_setting(setting).nominal, kept)


def _own(task: Nominal) -> EPuckTask:
    from tdac_envs.epuck.task import EPuckTask

    assert isinstance(task, EPuckTask)
    return task


EPUCK = EPuckEnvironment()
