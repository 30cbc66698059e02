"""What one judged episode did: the judge's own record, never the controller's."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tdac_agent.errors import RunError
from tdac_envs.core.errors import why
from tdac_envs.core.intake import read_array, read_file, read_zip

SCHEMA_VERSION = 1
MOST_BYTES = 256_000_000
Outcome = Literal["reached", "collision", "out of time", "stopped", "not run", "error"]


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Poses and actions of an episode of T steps.

    Attributes:
        poses: Shape (T + 1, 3), float64: x, y (px or m), heading (rad), start included.
        actions: Shape (T, 2), float32: left and right wheel, fractions as applied.
        path_distances: Shape (T + 1,), float64: shortest free path left, px or m.
        ranges: Shape (T + 1, n), float32: what the distance sensors read, as the
            controller saw it; px, or the readings of ps0 to ps7.
        collisions: Number of steps with a contact.
        dt: Duration of a step, s.
    """

    poses: NDArray[np.float64]
    actions: NDArray[np.float32]
    path_distances: NDArray[np.float64]
    ranges: NDArray[np.float32]
    collisions: int
    dt: float

    @property
    def steps(self) -> int:
        """Number of steps, T."""
        return len(self.actions)

    def every(self, stride: int) -> list[int]:
        """Every so many steps from the start on, and the last one."""
        return [*range(0, self.steps, stride), self.steps]

    def save(self, path: Path) -> None:
        """Writes an `.npz` with one array per attribute."""
        np.savez_compressed(
            path,
            schema_version=SCHEMA_VERSION,
            poses=self.poses,
            actions=self.actions,
            path_distances=self.path_distances,
            ranges=self.ranges,
            collisions=self.collisions,
            dt=self.dt,
        )

    @classmethod
    def load(cls, path: Path) -> Trajectory:
        """Reads what `save` wrote.

        Raises:
            RunError: The file is missing, damaged or something else.
        """
        try:
            data = _arrays(read_file(path, MOST_BYTES))
            if data["schema_version"] != SCHEMA_VERSION:
                raise ValueError(f"schema version {data['schema_version']}")
            loaded = cls(
                data["poses"],
                data["actions"],
                data["path_distances"],
                data["ranges"],
                int(data["collisions"]),
                float(data["dt"]),
            )
            _check_shapes(loaded)
        except (OSError, ValueError, TypeError, LookupError, OverflowError) as error:
            raise RunError(f"{path} is no trajectory: {why(error)}") from error
        return loaded


def _arrays(content: bytes) -> dict[str, NDArray[Any]]:
    """The arrays of an `.npz` file; raises ValueError where it is something else."""
    parts = read_zip(content, MOST_BYTES)
    return {name.removesuffix(".npy"): read_array(part) for name, part in parts.items()}


def nominal_first(path: Path) -> tuple[bool, str]:
    """Sorts the files of episodes: the nominal one first."""
    return path.stem != "nominal", path.stem


def _check_shapes(trajectory: Trajectory) -> None:
    """Refuses arrays that do not belong together."""
    length = len(trajectory.poses)
    for name, shape in (
        ("poses", (length, 3)),
        ("actions", (length - 1, 2)),
        ("path_distances", (length,)),
        ("ranges", (length, trajectory.ranges.shape[-1])),
    ):
        array = getattr(trajectory, name)
        if array.shape != shape or array.dtype.kind != "f":
            got = f"{array.dtype} {array.shape}"
            raise ValueError(f"expected {name} as floats {shape}, got {got}")


@dataclass(frozen=True, slots=True, eq=False)
class Rollout:
    """A judged episode.

    Attributes:
        name: `nominal`, `jitter 1` ….
        held_out: Whether feedback may tell only pass or fail of it.
        outcome: How it ended; `error` where the controller failed, `stopped` where
            it ran for fewer steps than the horizon on purpose, `not run` where an
            earlier failure made it pointless.
        trajectory: The judge's record.
        goal: (x, y), px or m.
        radius: Body radius, px or m.
        tolerance: Goal tolerance, px or m.
        error: What the controller did wrong, in one line, for `error` and `not run`.
        call_ms: Mean of the time of a policy call without what its process stood in
            line for a CPU, and 99th percentile with it, ms.
        returned: What `run_episode` returned, for an episode driven by it.
        timed_out: Whether the controller was too slow, in one call or on average.
        may_pass: Whether that may have been the machine's doing, and is worth a retry.
        rooms: Shape (T + 1,): distance from the robot's centre to what is solid, px (of
            the pixel's centre) or m; empty where it was not recorded.
        calls: Shape (T,): seconds that each policy call took; empty likewise.
    """

    name: str
    held_out: bool
    outcome: Outcome
    trajectory: Trajectory
    goal: tuple[float, float]
    radius: float
    tolerance: float
    error: str | None = None
    call_ms: tuple[float, float] = (0.0, 0.0)
    returned: Any = None
    timed_out: bool = False
    may_pass: bool = False
    rooms: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    calls: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))

    @property
    def reached(self) -> bool:
        """Whether the goal was reached."""
        return self.outcome == "reached"

    @property
    def collisions(self) -> int:
        """Number of contacts."""
        return self.trajectory.collisions

    def distances(self, kind: str = "geodesic") -> NDArray[np.float64]:
        """Distance to the goal before each step and at the end, px or m.

        Args:
            kind: `geodesic` (shortest free path) or `euclidean`.
        """
        if kind == "geodesic":
            return self.trajectory.path_distances
        delta = self.trajectory.poses[:, :2] - np.asarray(self.goal)
        return np.asarray(np.hypot(delta[:, 0], delta[:, 1]))
