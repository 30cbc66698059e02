"""What the tasks of the two environments have in common, and where they differ."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from gymnasium import Space
from numpy.typing import NDArray

from tdac_agent.tasks.units import Units
from tdac_envs.drawing.canvas import Image
from tdac_envs.drive.env import Observation
from tdac_envs.drive.task import Pose
from tdac_envs.grid.plan import Path as Way


class Nominal(Protocol):
    """A feasible task: `Map2DTask` in pixels, `EPuckTask` in metres."""

    @property
    def env_id(self) -> str:
        """Gymnasium id of the environment, for the registry."""

    @property
    def start(self) -> Pose:
        """Nominal start pose."""

    @property
    def goal(self) -> tuple[float, float]:
        """Point (x, y)."""

    @property
    def goal_tolerance(self) -> float:
        """How near to the goal is at the goal."""

    @property
    def dt(self) -> float:
        """Duration of a step, s."""

    @property
    def horizon(self) -> int:
        """Steps before an episode is cut off."""

    @property
    def shortest(self) -> float:
        """d0, length of the shortest path from the nominal start."""

    @property
    def body_radius(self) -> float:
        """Of the disc."""

    @property
    def axle_length(self) -> float:
        """Distance between the wheels."""

    @property
    def full_step(self) -> float:
        """Way of one step at full speed."""

    def path_from(self, start: Pose) -> Way:
        """Shortest path for the body, shape (n, 2); empty where there is none."""

    def jittered(self, random: np.random.Generator) -> Pose:
        """A feasible start of the jitter variation."""


class JudgedEnv(Protocol):
    """An environment whose episodes are judged."""

    @property
    def observation_space(self) -> Space[Any]:
        """Of a `Dict` of boxes."""

    @property
    def action_space(self) -> Space[Any]:
        """A box for both wheels."""

    @property
    def readings(self) -> str:
        """Key of the distance sensors in an observation."""

    @property
    def nominal(self) -> Nominal:
        """The task that it was made for."""

    @property
    def task(self) -> Nominal:
        """The task of the episode: its start and goal as they were drawn."""

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Starts an episode."""

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Steps once."""

    def pose(self) -> NDArray[np.float64]:
        """The true pose, shape (3,)."""


class Params(Protocol):
    """Contents of `params.json`."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person should look at."""

    def model_dump_json(self, *, indent: int | None = None) -> str:
        """The file's text."""


class Original(NamedTuple):
    """What a task was made from, which a run folder keeps a copy of.

    Attributes:
        name: Of the copy.
        file: The original.
    """

    name: str
    file: Path


class Setting(Protocol):
    """Environment, world and start of a task: `Map2DSetting` or `EPuckSetting`.

    Whatever depends on the environment is asked of it, or of its type.
    """

    @property
    def nominal(self) -> Nominal:
        """The feasible task."""

    @property
    def params(self) -> Params:
        """Contents of `params.json`."""

    @property
    def original(self) -> Original | None:
        """Map image or world, where there is a file."""

    @property
    def units(self) -> Units:
        """Of places and lengths."""

    @property
    def left_out(self) -> tuple[str, ...]:
        """Nodes that may be solid and are ignored, in words."""

    def remarks(self) -> list[str]:
        """How map or world was read, in lines."""

    def env_kwargs(self) -> dict[str, Any]:
        """Arguments that make the environment."""

    def make_env(self, **options: Any) -> JudgedEnv:
        """The environment; options as for its class."""

    def noise(self, relative: float) -> dict[str, float]:
        """Option of the environment for a relative noise of its distance sensors."""

    def facts(self) -> dict[str, Any]:
        """What decides an episode, as JSON; map or world by its hash."""

    def world_sha256(self) -> str:
        """Hash of map or world."""

    def write_files(self, folder: Path) -> None:
        """Writes what a controller may read, but for `sensors.py`."""

    def preview(self) -> Image:
        """How map or world was read, as a picture for people, uint8 RGB."""

    def portable(self) -> dict[str, Any]:
        """Keys of a `task.yaml` beside these files that say the same."""
