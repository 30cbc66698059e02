"""The judge's record of an episode; nothing in it comes from the controller."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tdac_agent.errors import RunError
from tdac_envs.core.errors import one_line_reason
from tdac_envs.core.intake import read_array, read_file, read_zip
from tdac_envs.drawing.marks import GHOST_SECONDS
from tdac_envs.drive.smallest_gap import SmallestGap

SCHEMA_VERSION = 1
MOST_BYTES = 256_000_000
Outcome = Literal["reached", "collision", "out of time", "stopped", "not run", "error"]
Contact = Literal["wall", "mover", "mover_standing"]


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Poses and actions of an episode of T steps.

    Attributes:
        poses: Shape (T + 1, 3), float64: x, y (px or m), heading (rad), start included.
        actions: Shape (T, 2), float32: left and right wheel, fractions as applied.
        path_distances: Shape (T + 1,), float64: grid path to the goal, px or m.
        ranges: Shape (T + 1, n), float32: observed readings of the distance sensors,
            px, or the raw readings of ps0 to ps7.
        collisions: Number of steps with a contact.
        dt: Duration of a step, s.
        movers: Shape (T + 1, n, 3), float32: x, y, radius (px) of each moving obstacle;
            None without any, when the file has no such array.
    """

    poses: NDArray[np.float64]
    actions: NDArray[np.float32]
    path_distances: NDArray[np.float64]
    ranges: NDArray[np.float32]
    collisions: int
    dt: float
    movers: NDArray[np.float32] | None = None

    @property
    def steps(self) -> int:
        """Number of steps, T."""
        return len(self.actions)

    def every(self, stride: int) -> list[int]:
        """Returns every `stride`-th step from the start, and the last one."""
        return [*range(0, self.steps, stride), self.steps]

    def ghosts(self, step: int) -> list[NDArray[np.float64]]:
        """Returns the movers until a step, for pictures of them with their trails.

        Returns:
            Those in the last second, oldest first, each of shape (n, 3): x, y, radius;
            an empty list without movers.
        """
        if self.movers is None:
            return []
        since = max(step - math.ceil(GHOST_SECONDS / self.dt), 0)
        return list(self.movers[since : step + 1].astype(np.float64))

    def save(self, path: Path, calls: NDArray[np.float64] | None = None) -> None:
        """Writes an `.npz` with one array per attribute.

        Args:
            path: The file.
            calls: Duration of each call of the policy, s, to be kept beside them.
        """
        arrays: dict[str, Any] = {
            "schema_version": SCHEMA_VERSION,
            "poses": self.poses,
            "actions": self.actions,
            "path_distances": self.path_distances,
            "ranges": self.ranges,
            "collisions": self.collisions,
            "dt": self.dt,
        }
        if self.movers is not None:
            arrays["movers"] = self.movers
        if calls is not None:
            arrays["calls"] = calls.astype(np.float32)
        np.savez_compressed(path, **arrays)

    @classmethod
    def load(cls, path: Path) -> Trajectory:
        """Reads a file of `save`.

        Raises:
            RunError: The file is missing, damaged or of another kind.
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
                data.get("movers"),
            )
            _check_shapes(loaded)
        except (OSError, ValueError, TypeError, LookupError, OverflowError) as error:
            raise RunError(
                f"{path} is not a trajectory: {one_line_reason(error)}"
            ) from error
        return loaded


def load_calls(path: Path) -> NDArray[np.float32]:
    """The durations of the calls beside a trajectory, s; none if it has none.

    Raises:
        RunError: The file is missing or damaged.
    """
    try:
        found = _arrays(read_file(path, MOST_BYTES)).get("calls", np.zeros(0))
        return np.asarray(found, np.float32).reshape(-1)
    except (OSError, ValueError, LookupError) as error:
        raise RunError(f"{path}: {one_line_reason(error)}") from error


def _arrays(content: bytes) -> dict[str, NDArray[Any]]:
    """Returns the arrays of an `.npz` file; raises ValueError for other files."""
    parts = read_zip(content, MOST_BYTES)
    return {name.removesuffix(".npy"): read_array(part) for name, part in parts.items()}


def nominal_first(path: Path) -> tuple[bool, str]:
    """Sort key for episode files: the nominal one first."""
    return path.stem != "nominal", path.stem


def _check_shapes(trajectory: Trajectory) -> None:
    """Raises ValueError if the arrays do not fit together."""
    length = len(trajectory.poses)
    shapes: dict[str, tuple[int, ...]] = {
        "poses": (length, 3),
        "actions": (length - 1, 2),
        "path_distances": (length,),
        "ranges": (length, trajectory.ranges.shape[-1]),
    }
    if trajectory.movers is not None:
        shapes["movers"] = (length, *trajectory.movers.shape[1:2], 3)
    for name, shape in shapes.items():
        array = getattr(trajectory, name)
        if array.shape != shape or array.dtype.kind != "f":
            got = f"{array.dtype} {array.shape}"
            raise ValueError(f"expected {name} as floats {shape}, got {got}")


@dataclass(frozen=True, slots=True, eq=False)
class Rollout:
    """A judged episode.

    Attributes:
        name: `nominal`, `jitter 1` ….
        held_out: Whether feedback may reveal only pass or fail.
        outcome: How it ended: `error` if the controller failed, `stopped` at a step
            limit below the horizon, `not run` if an earlier failure made it pointless.
        trajectory: The judge's record.
        goal: (x, y), px or m.
        radius: Body radius, px or m.
        tolerance: Goal tolerance, px or m.
        error: The controller's error in one line, for `error` and `not run`.
        call_ms: Duration of a policy call, ms: the mean without run-queue wait time,
            and the 99th percentile including it.
        returned: Return value of `run_episode`, if it drove the episode.
        timed_out: Whether the controller was too slow, in one call or on average.
        is_retryable: Whether a busy machine may be the reason, so a retry may pass.
        rooms: Shape (T + 1,): distance from the robot's centre to the nearest obstacle,
            px (for the centre of its pixel) or m; empty if not recorded.
        calls: Shape (T,): duration of each policy call, s; empty if not recorded.
        printed: What the controller printed, of bounded length.
        contact: What the body touched at last, as in `info`; None if nothing, or if the
            environment does not say.
        smallest_gap: Smallest gap between body and obstacles, along the exact arcs;
            None if no step was taken.
        close_gap: Smallest gap that was too close, likewise; None without any.
        required_gap: Gap that the robot should keep, px or m.
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
    is_retryable: bool = False
    rooms: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    calls: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    printed: str = ""
    contact: Contact | None = None
    smallest_gap: SmallestGap | None = None
    close_gap: SmallestGap | None = None
    required_gap: float = 0.0

    @property
    def reached(self) -> bool:
        """Whether the goal was reached."""
        return self.outcome == "reached"

    @property
    def collisions(self) -> int:
        """Number of contacts."""
        return self.trajectory.collisions

    def distances(self, kind: str = "geodesic") -> NDArray[np.float64]:
        """Returns the distance to the goal before each step and at the end, px or m.

        Args:
            kind: `geodesic` (grid path) or `euclidean`.
        """
        if kind == "geodesic":
            return self.trajectory.path_distances
        delta = self.trajectory.poses[:, :2] - np.asarray(self.goal)
        return np.asarray(np.hypot(delta[:, 0], delta[:, 1]))
