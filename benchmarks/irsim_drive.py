"""Drives map controllers in ir-sim, a simulator of others.

ir-sim moves the robot (its differential kinematics, one step per control period), says
what it touches, and casts the rays of its lidar. The environment computes what the
motors make of a command, what the controller observes besides ranges, and whether the
goal is reached. Controllers run in this process; only for those of this repository.
"""

from __future__ import annotations

import math
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import irsim  # type: ignore[import-untyped]
import numpy as np
import yaml
from numpy.typing import NDArray

from benchmarks.in_process import Imported
from tdac_agent.episodes.episode import Record, not_driven, run_policy
from tdac_agent.episodes.trajectory import Rollout
from tdac_agent.evaluation.policies import Entrant
from tdac_agent.problems.episodes import episodes_of
from tdac_agent.problems.part import Part
from tdac_agent.sandbox import ControllerFault
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.task import Task
from tdac_agent.verification.judge.episode_job import opened
from tdac_agent.verification.judge.worlds import Program
from tdac_envs.core.addresses import Words
from tdac_envs.drive.env import Observation
from tdac_envs.drive.stepping import CONTACT, FORWARD, HEADING, TOUCHED, TURN
from tdac_envs.ladder.task_sets import TaskSet
from tdac_envs.map2d.carried import finish, metres_of, turn_wheels
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.map2d.robot import Map2DArrays
from tdac_envs.map2d.task import Map2DTask
from tdac_envs.physics.boxes import (
    Edges,
    fence,
    fence_width,
    middle_and_sides,
    rectangles,
)
from tdac_envs.physics.moved import Pose, arc_between

_UNLIMITED = 1e6


class IrSim:
    """A robot on a map in ir-sim; takes the place of `map2d.carried.Carried`.

    ir-sim has metres and y up; a map without a resolution has the one of MuJoCo there.

    Args:
        env: The environment, whose task has begun.
    """

    def __init__(self, env: Map2DEnv) -> None:
        self._metres = metres_of(env.setup, env.task)
        with tempfile.NamedTemporaryFile("w", suffix=".yaml", delete=False) as file:
            yaml.safe_dump(scene_of(env.task, self._metres), file)
        try:
            self._world = irsim.make(
                file.name, display=False, disable_all_plot=True, log_level="CRITICAL"
            )
        finally:
            os.unlink(file.name)
        self._robot = self._world.robot
        self.scan(env.robot.ranges)

    def scan(self, ranges: NDArray[np.float32]) -> None:
        """Fills in the ranges; our first ray is the leftmost one, ir-sim's the last."""
        found = self._robot.get_lidar_scan()["ranges"]
        ranges[:] = found[::-1] / self._metres

    def step(self, words: Words, robot: Map2DArrays, task: Map2DTask) -> None:
        """Runs one step; see `Carried.step`."""
        state = robot.state
        turn_wheels(words)
        forward, turn = state[FORWARD : TURN + 1].tolist()
        begin: Pose = tuple(state[: HEADING + 1].tolist())
        speeds = forward * self._metres / task.dt, -turn / task.dt
        self._world.step(np.array(speeds).reshape(2, 1))
        end = self._pose()
        state[: HEADING + 1] = end
        state[FORWARD], state[TURN] = arc_between(begin, end)
        touched = bool(self._robot.collision_flag)
        robot.outcome[TOUCHED] = robot.outcome[CONTACT] = touched
        finish(words)
        self.scan(robot.ranges)

    def _pose(self) -> Pose:
        x, y, heading = self._robot.state.ravel()[:3].tolist()
        return x / self._metres, -y / self._metres, math.remainder(-heading, math.tau)


def scene_of(task: Map2DTask, metres: float) -> dict[str, Any]:
    """The world of a task in ir-sim's own format: walls are rectangles."""
    cells, own, start = task.terrain.grid.cells, task.robot, task.start
    rows, columns = cells.shape
    wide, walls = fence_width(metres), [*rectangles(cells)]
    walls += fence(rows, columns, metres)
    angles = own.angles()
    return {
        "world": {
            "width": (columns + 2 * wide) * metres,
            "height": (rows + 2 * wide) * metres,
            "offset": [-wide * metres, -(rows + wide) * metres],
            "step_time": task.dt,
            "sample_time": task.dt,
            "collision_mode": "stop",
        },
        "robot": [
            {
                "kinematics": {"name": "diff"},
                "shape": {"name": "circle", "radius": own.radius * metres},
                "state": [start.x * metres, -start.y * metres, -start.heading],
                "vel_min": [-_UNLIMITED, -_UNLIMITED],
                "vel_max": [_UNLIMITED, _UNLIMITED],
                "acce": [math.inf, math.inf],
                "sensors": [
                    {
                        "name": "lidar2d",
                        "range_min": 0,
                        "range_max": own.range_max * metres,
                        "angle_range": float(angles[-1] - angles[0]),
                        "number": own.n_rays,
                    }
                ],
            }
        ],
        "obstacle": [_wall(one, metres) for one in walls],
    }


def _wall(one: Edges, metres: float) -> dict[str, Any]:
    (x, y), along, across = middle_and_sides(one, metres)
    shape = {"name": "rectangle", "length": along, "width": across}
    return {"shape": shape, "state": [x, y, 0.0], "static": True}


class InIrSim:
    """An environment whose robot moves in ir-sim, from the reset on.

    Args:
        plain: An environment with the exact step and exact ranges.
    """

    def __init__(self, plain: Any) -> None:
        assert not plain.setup.has_inexact_ranges
        self._plain = plain

    def __getattr__(self, name: str) -> Any:
        return getattr(self._plain, name)

    def reset(self, **how: Any) -> tuple[Observation, dict[str, Any]]:
        """Begins as the plain environment does, then hands the robot over."""
        plain = self._plain
        plain._carried = None
        _, info = plain.reset(**how)
        plain._carried = IrSim(plain)
        plain._bind()
        return plain._observation(), info


@dataclass(frozen=True, slots=True)
class _Folder:
    """Takes the files that a child would get."""

    path: Path

    def copy_files(
        self, workdir: Path, source: bytes, weights: bytes | None = None
    ) -> None:
        assert weights is None
        for file in workdir.iterdir():
            if file.is_file():
                (self.path / file.name).write_bytes(file.read_bytes())
        (self.path / "controller.py").write_bytes(source)


def rollouts(
    entrant: Entrant, problem: Task | TaskSet, numbers: range, split: str
) -> Iterator[Rollout]:
    """Drives a controller in some episodes of a problem on maps."""
    own = Disturbance.none() if isinstance(problem, Task) else None
    part = Part(tuple(numbers), split, disturbance=own)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        laid_out = episodes_of(problem).worlds(part, folder, entrant.policy)
        worlds = opened(laid_out)
        for number in numbers:
            place = folder / f"controller-{number}"
            place.mkdir()
            source, file = entrant.source, entrant.policy.file
            if source is None and file is not None:
                source = file.read_bytes()
            assert source is not None
            worlds.supply(_Folder(place), number, Program(source))  # type: ignore[arg-type]
            record: Record = worlds.record(number)
            record.env = InIrSim(record.env)
            record.seen = worlds.seen
            with _within(place):
                try:
                    driver = Imported(place)
                except ControllerFault as fault:
                    rollout = not_driven(record, str(number), fault)
                else:
                    rollout = run_policy(
                        driver, record, str(number), held_out=False, deadline=math.inf
                    )
            yield rollout


@contextmanager
def _within(folder: Path) -> Iterator[None]:
    """As in a controller's process: works in its folder, which has its modules."""
    before, known = Path.cwd(), set(sys.modules)
    os.chdir(folder)
    sys.path.insert(0, str(folder))
    try:
        yield
    finally:
        os.chdir(before)
        sys.path.remove(str(folder))
        for name in set(sys.modules) - known:
            if str(folder) in (getattr(sys.modules[name], "__file__", None) or ""):
                del sys.modules[name]
