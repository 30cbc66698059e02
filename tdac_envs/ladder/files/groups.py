"""Shares worlds among splits, so that none has a map or an origin of another."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Sequence
from itertools import accumulate

from tdac_envs.ladder.files.found import FoundWorld
from tdac_envs.ladder.files.spec import AnySplit, FileSplit

SHARES: dict[FileSplit, int] = {"train": 3, "dev": 1, "test": 1}
"""Expected shares of the splits; of those that a set has."""


def shared_out(
    worlds: Sequence[FoundWorld],
    splits: Sequence[FileSplit],
    tests: Collection[str] = (),
) -> dict[AnySplit, tuple[FoundWorld, ...]]:
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
    shared: dict[AnySplit, list[FoundWorld]] = {split: [] for split in splits}
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


def groups(worlds: Sequence[FoundWorld]) -> list[str]:
    """The name of each world's group: its first origin, or its first map's hash."""
    names = [links(each) for each in worlds]
    group: dict[str, set[str]] = {}
    for link in names:
        joined = set().union(link, *(group.get(name, set()) for name in link))
        for name in joined:
            group[name] = joined
    # "from …" comes before "map …".
    return [min(group[next(iter(link))]) for link in names]


def links(world: FoundWorld) -> set[str]:
    """What makes a world one of a group: its map, and its origin if that is known."""
    origin = [f"from {world.origin}"] if world.origin else []
    return {f"map {world.content}", *origin}


def _split_of(group: str, splits: Sequence[FileSplit]) -> FileSplit:
    digest = hashlib.sha256(group.encode("utf-8", "surrogatepass")).digest()
    bounds = list(accumulate(SHARES[split] for split in splits))
    ticket = int.from_bytes(digest[:8], "big") % bounds[-1]
    return next(s for s, b in zip(splits, bounds, strict=True) if ticket < b)
