"""Interfaces that the tasks of all environments implement."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from gymnasium import Space
from numpy.typing import NDArray

from tdac_agent.tasks.units import Units
from tdac_envs.drawing.canvas import Image
from tdac_envs.drive.env import Observation
from tdac_envs.drive.gap_search import GapWatch
from tdac_envs.drive.task import Pose, radii_text
from tdac_envs.grid.plan import Path as Way


class Nominal(Protocol):
    """A feasible task: `Map2DTask` in pixels, `EPuckTask` in metres."""

    @property
    def env_id(self) -> str:
        """Gymnasium id of the environment."""

    @property
    def start(self) -> Pose:
        """Nominal start pose."""

    @property
    def goal(self) -> tuple[float, float]:
        """Goal (x, y)."""

    @property
    def goal_tolerance(self) -> float:
        """Distance at which the goal is reached."""

    @property
    def dt(self) -> float:
        """Duration of a step, s."""

    @property
    def horizon(self) -> int:
        """Steps before an episode is truncated."""

    @property
    def shortest(self) -> float:
        """d0, length of the shortest grid path from the nominal start."""

    @property
    def body_radius(self) -> float:
        """Radius of the robot's disc."""

    @property
    def axle_length(self) -> float:
        """Distance between the wheels."""

    @property
    def full_step(self) -> float:
        """Distance driven in one step at full speed."""

    def path_from(self, start: Pose) -> Way:
        """Returns the shortest grid path to the goal, shape (n, 2); may be empty."""

    def shortest_path(self, start: Pose) -> Way:
        """Returns the corners of the body's shortest path to the goal, shape (n, 2).

        It is the grid path after every shortcut that the body can take; the only one
        that is called shortest path, printed and drawn. May be empty.
        """

    def jittered(self, random: np.random.Generator) -> Pose:
        """Returns a random feasible start of the jitter variation."""


def tolerance_text(setting: Setting) -> str:
    """Formats the goal tolerance of a setting: `0.2 m (1.0 radii)`."""
    own = setting.nominal
    length = setting.length_text(own.goal_tolerance)
    return f"{length} ({radii_text(own.goal_tolerance, own.body_radius)})"


class JudgedEnv(Protocol):
    """An environment whose episodes are judged."""

    @property
    def observation_space(self) -> Space[Any]:
        """A `Dict` of boxes."""

    @property
    def action_space(self) -> Space[Any]:
        """A box with one entry per wheel."""

    @property
    def readings(self) -> str:
        """Observation key of the distance sensors."""

    @property
    def nominal(self) -> Nominal:
        """The task of the environment."""

    @property
    def task(self) -> Nominal:
        """The task of the current episode, with the start and goal drawn for it."""

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Starts an episode."""

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Advances the episode by one step."""

    def pose(self) -> NDArray[np.float64]:
        """Returns the true pose x, y, heading; shape (3,)."""

    def discs(self) -> NDArray[np.float64]:
        """Returns the movers as they are now, shape (n, 3): x, y, radius (px or m)."""

    def watch_gap(self) -> GapWatch:
        """Returns a watch of the smallest gap in the episode that has just begun."""

    @property
    def required_gap(self) -> float:
        """The gap to obstacles that the robot should keep, px or m."""


class Params(Protocol):
    """Contents of `params.json`."""

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks that the user should check."""

    def read(self, written: Any) -> Any:
        """Returns the parameters of such a file, from its parsed contents.

        Raises:
            ValidationError: A field is missing, wrong or unknown.
        """

    def model_dump_json(self, *, indent: int | None = None) -> str:
        """Returns the file's text."""


class Original(NamedTuple):
    """The file a task was made from; a run folder keeps a copy.

    Attributes:
        name: File name of the copy.
        file: The original.
    """

    name: str
    file: Path


@runtime_checkable
class Setting(Protocol):
    """Map or world, start, goal and robot: `Map2DSetting` or `EPuckSetting`."""

    @property
    def nominal(self) -> Nominal:
        """The feasible task."""

    @property
    def params(self) -> Params:
        """Contents of `params.json`."""

    @property
    def original(self) -> Original | None:
        """Map image or world file; None if there is no file."""

    @property
    def units(self) -> Units:
        """Units of places and lengths."""

    @property
    def shown(self) -> Units:
        """The same, but printed in the units that the user has chosen."""

    def in_metres(self) -> Setting:
        """Returns the same task, shown in metres of the map's frame.

        Raises:
            TaskError: It has no other units than its own.
        """

    def without_movers(self) -> Setting:
        """Returns the same task without moving obstacles."""

    def observed(self) -> JudgedEnv:
        """Constructs the environment as a controller observes it."""

    def seen(self, observation: Observation) -> Observation:
        """Converts an observation of `make_env` to what a controller observes."""

    def length_text(self, length: float) -> str:
        """Formats a length in the units that the user has chosen: `12 px`, `0.6 m`."""

    @property
    def left_out(self) -> tuple[str, ...]:
        """Descriptions of the ignored nodes that may be solid."""

    def remarks(self) -> list[str]:
        """Returns lines that describe how the map or world was read."""

    def env_kwargs(self) -> dict[str, Any]:
        """Returns the constructor arguments of the environment."""

    def make_env(self, **options: Any) -> JudgedEnv:
        """Constructs the environment; `options` override its constructor arguments."""

    def displaced(self, x: float, y: float) -> dict[str, Any]:
        """Returns the environment's options with all obstacles shifted, px or m."""

    @property
    def has_metres(self) -> bool:
        """Whether the size of the world in metres is known."""

    def noise(self, relative: float) -> dict[str, float]:
        """Returns the environment's option for relative distance sensor noise."""

    @property
    def has_dropouts(self) -> bool:
        """Whether the robot is on a map: it has `range_dropout` and `pose_noise`."""

    @property
    def disturbances(self) -> dict[str, Any]:
        """What the robot's file says of its disturbances, in units of the task."""

    def length_of(self, length: float) -> float:
        """Converts a length in units of the task to those of the environment."""

    def facts(self) -> dict[str, Any]:
        """Returns all that determines an episode, the map or world by its hash."""

    def world_sha256(self) -> str:
        """Returns the hash of the map or world."""

    def write_files(self, folder: Path) -> None:
        """Writes the files that a controller may read, except `sensors.py`."""

    def preview(self) -> Image:
        """Draws the map or world as it was read, uint8 RGB."""

    def ends(self) -> dict[str, Any]:
        """Returns the `task.yaml` keys `start`, `goal` and `tolerance`."""

    def portable(self) -> dict[str, Any]:
        """Returns the `task.yaml` keys that refer to the files of `write_files`."""
