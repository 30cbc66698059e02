"""The worlds of a set that come from files: read, tested and shared among splits."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from tdac_envs.core.errors import TaskError, one_line_reason
from tdac_envs.ladder.files.barn import read_barn
from tdac_envs.ladder.files.found import FoundWorld
from tdac_envs.ladder.files.groups import shared_out
from tdac_envs.ladder.files.index import files_of, read_folder
from tdac_envs.ladder.files.spec import FileSplit, FilesSpec

Stamp = tuple[tuple[str, int, int], ...]


@dataclass(frozen=True, eq=False)
class FileWorlds:
    """The feasible worlds of a folder or a file.

    Attributes:
        splits: The worlds of each split.
        skipped: Why the other tasks cannot be used, a line for each.
        sha256: Hash of the worlds' maps and tasks; files elsewhere have the same.
    """

    splits: Mapping[FileSplit, tuple[FoundWorld, ...]]
    skipped: tuple[str, ...]
    sha256: str

    @property
    def counts(self) -> dict[str, int]:
        """Number of worlds of each split."""
        return {split: len(worlds) for split, worlds in self.splits.items()}

    @property
    def largest_side(self) -> int:
        """Largest width or height of a map, px."""
        every = (world for worlds in self.splits.values() for world in worlds)
        return max(max(world.shape) for world in every)


def opened(spec: FilesSpec, radius: float, tolerance: float) -> FileWorlds:
    """Reads all maps, and tests whether each task is feasible.

    A process keeps the result until a file changes.

    Args:
        spec: Where the worlds are.
        radius: Radius of the body, px.
        tolerance: Distance at which the goal is reached, px.

    Raises:
        TaskError: A file is missing or not valid, a task is not feasible (unless
            `spec` skips it), or none is.
    """
    files = [spec.path] if spec.barn else files_of(spec.path)
    return _opened(spec, radius, tolerance, tuple(map(_stamp, files)))


def _stamp(path: Path) -> tuple[str, int, int]:
    try:
        status = path.stat()
    except (OSError, ValueError) as error:
        raise TaskError(f"{path}: {one_line_reason(error)}") from None
    return str(path), status.st_mtime_ns, status.st_size


@lru_cache(maxsize=4)
def _opened(
    spec: FilesSpec,
    radius: float,
    tolerance: float,
    stamps: Stamp,  # noqa: ARG001 - tells apart what the cache keeps
) -> FileWorlds:
    lenient, skipped = spec.infeasible == "skip", list[str]()
    if spec.barn:
        found = read_barn(spec.path, spec.resolution)
    else:
        found = read_folder(spec.path, radius, skipped if lenient else None)
    feasible = []
    for world in found:
        problem = world.problem(radius, tolerance)
        if problem is None:
            feasible.append(world)
            continue
        skipped.append(f"{world.file}: {problem}")
        if not lenient:
            raise TaskError(
                f"{skipped[-1]}; `infeasible: skip` leaves such tasks out of the set"
            )
    if not feasible:
        raise TaskError(
            f"{spec.path} has no feasible world; the first of {len(skipped)}: "
            f"{skipped[0]}"
        )
    joined = "".join(sorted(world.sha256 for world in feasible))
    digest = hashlib.sha256(joined.encode()).hexdigest()
    return FileWorlds(shared_out(feasible, spec.splits), tuple(skipped), digest)
