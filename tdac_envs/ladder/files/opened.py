"""The worlds of a set that come from files: read, tested and shared among splits."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import accumulate
from pathlib import Path

from tdac_envs.core.errors import TaskError, one_line_reason
from tdac_envs.core.hashing import sha256_of
from tdac_envs.ladder.files.barn import read_barn
from tdac_envs.ladder.files.file_world import FileWorld
from tdac_envs.ladder.files.index import files_of, read_folder
from tdac_envs.ladder.files.spec import AnySplit, FileSplit, FilesSpec

Stamp = tuple[tuple[str, int, int], ...]
SHARES: dict[FileSplit, int] = {"train": 3, "dev": 1, "test": 1}
"""Expected shares of the splits; of those that a set has."""
_SHARED = {"map": "map", "from": "origin"}


@dataclass(frozen=True, eq=False)
class FileWorlds:
    """The feasible worlds of a folder or a file.

    Attributes:
        splits: The worlds of each split.
        skipped: Why the other tasks cannot be used, a line for each.
        sha256: Hash of the worlds' maps and tasks; files elsewhere have the same.
        hidden_folder: Folder of the split `hidden`, if there is one; it is no part of
            the other attributes but `splits`.
        hidden_sha256: Hash of its worlds.
        runs: Episodes of each world.
    """

    splits: Mapping[AnySplit, tuple[FileWorld, ...]]
    skipped: tuple[str, ...]
    sha256: str
    hidden_folder: Path | None = None
    hidden_sha256: str | None = None
    runs: int = 1

    @property
    def counts(self) -> dict[str, int]:
        """Number of episodes of each split."""
        return {s: len(worlds) * self.runs for s, worlds in self.splits.items()}

    def of(self, split: str, index: int) -> FileWorld:
        """The world of an episode: all have their first run, then all their second.

        Args:
            split: The split, which has worlds.
            index: Number of the episode, from 0.
        """
        worlds = next(own for name, own in self.splits.items() if name == split)
        return worlds[index % len(worlds)]

    def with_hidden(
        self, folder: Path, spec: FilesSpec, radius: float, tolerance: float
    ) -> FileWorlds:
        """The same with a split `hidden`: a folder of held-out maps.

        Args:
            folder: Its folder, with an index as that of the set.
            spec: Where the other worlds are.
            radius: Radius of the body, px.
            tolerance: Distance at which the goal is reached, px.

        Raises:
            TaskError: As `opened` does, or it has a map or an origin of the set.
        """
        own = FilesSpec(
            folder=folder,
            splits=("test",),
            infeasible=spec.infeasible,
            runs=spec.runs,
            metres=spec.metres,
        )
        found = opened(own, radius, tolerance)
        worlds = found.splits["test"]
        public = set().union(*(links(each) for s in self.splits.values() for each in s))
        for world in worlds:
            if shared := links(world) & public:
                what = sorted(shared)[0].partition(" ")[0]
                raise TaskError(
                    f"{world.file}: its {_SHARED[what]} is also in the public part of "
                    "the set, so its author may have seen it"
                )
        return replace(
            self,
            splits={**self.splits, "hidden": worlds},
            hidden_folder=folder.resolve(),
            hidden_sha256=found.sha256,
        )

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
        found = read_folder(
            spec.path, radius, skipped if lenient else None, spec.metres
        )
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
    digest = sha256_of(*sorted(world.sha256 for world in feasible))
    try:
        splits = shared_out(feasible, spec.splits, spec.tests)
    except ValueError as error:
        raise TaskError(f"{spec.path}: {error}") from None
    return FileWorlds(splits, tuple(skipped), digest, runs=spec.runs)


def shared_out(
    worlds: Sequence[FileWorld],
    splits: Sequence[FileSplit],
    tests: Collection[str] = (),
) -> dict[AnySplit, tuple[FileWorld, ...]]:
    """The worlds of each split, in an order that follows from their hashes.

    Worlds with the same map or the same origin belong to a group, and so do those that
    are linked by others. The hash of its name decides where a group goes, so further
    files do not move it.

    Args:
        worlds: All worlds.
        splits: The splits.
        tests: Names of the worlds of `test`, if they are given; the groups of these
            worlds go there, and no other.

    Raises:
        ValueError: There is no world of a name.
    """
    shared: dict[AnySplit, list[FileWorld]] = {split: [] for split in splits}
    named = groups(worlds)
    pairs = list(zip(worlds, named, strict=True))
    chosen = {group for world, group in pairs if world.name in tests}
    if unknown := set(tests) - {world.name for world in worlds}:
        raise ValueError(f"`tests`: there is no world {min(unknown)!r}")
    others = [split for split in splits if split != "test"] if tests else splits
    for world, group in pairs:
        split = "test" if group in chosen else _split_of(group, others)
        shared[split].append(world)
    return {
        split: tuple(sorted(found, key=lambda world: world.sha256))
        for split, found in shared.items()
    }


def groups(worlds: Sequence[FileWorld]) -> list[str]:
    """The name of each world's group: its first origin, or its first map's hash."""
    names = [links(each) for each in worlds]
    group: dict[str, set[str]] = {}
    for link in names:
        joined = set().union(link, *(group.get(name, set()) for name in link))
        for name in joined:
            group[name] = joined
    # "from …" comes before "map …".
    return [min(group[next(iter(link))]) for link in names]


def links(world: FileWorld) -> set[str]:
    """What makes a world one of a group: its map, and its origin if that is known."""
    origin = [f"from {world.origin}"] if world.origin else []
    return {f"map {world.content}", *origin}


def _split_of(group: str, splits: Sequence[FileSplit]) -> FileSplit:
    bounds = list(accumulate(SHARES[split] for split in splits))
    ticket = int(sha256_of(group)[:16], 16) % bounds[-1]
    return next(s for s, b in zip(splits, bounds, strict=True) if ticket < b)
