"""Results of benches: read, put together, and revealed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from tdac_agent.bench.arena import DRIVEN, folder_of, sealed_episodes, world_rows
from tdac_agent.bench.bench import RESULTS, WORLD_TABLE, publish, read_worlds
from tdac_agent.bench.compared import Driven, overall_of, pairs_of
from tdac_agent.bench.figures import draw_figures
from tdac_agent.bench.page import PAGE, write_page
from tdac_agent.bench.record import Bench, BenchRow, BenchSet
from tdac_agent.errors import RunError
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.storage.locks import LOCK_FILE, own_folder
from tdac_agent.verification.salt import SEALED
from tdac_envs.core.errors import TaskError, one_line_reason
from tdac_envs.core.intake import RECORD_BYTES, read_file
from tdac_envs.core.salt import read_salt
from tdac_envs.ladder.set_file import set_names

_COMPARED = {
    "sha256": "version",
    "driven_on": "dynamics",
    "split": "split",
    "worlds": "number of worlds",
    "salt_sha256": "salt",
    "physics": "physics",
}
"""What all benches of a set have in common, and its name in messages."""


def write_merged(folders: Sequence[Path], out: Path) -> Bench:
    """Writes the results in folders as one bench: tables, figures and a page.

    The page has no replays.

    Args:
        folders: Folders of benches.
        out: Folder for `bench.json`, `worlds.csv`, figures and `bench.html`.

    Raises:
        RunError: As for `merged`; or `out` is the folder of a bench, or cannot be
            written.
    """
    found = merged(folders)
    table = pd.concat([_table(folder) for folder in folders])
    table = table.drop_duplicates(["set", "entrant", "file", "index"])
    written = RESULTS, WORLD_TABLE, PAGE, "*.svg"
    with own_folder(out, *written, who="bench"):
        if any((out / name).exists() for name in (DRIVEN, SEALED)):
            raise RunError(f"{out} has a bench of its own: give another --out")
        figures = draw_figures(found, table, out)
        write_page(found, {}, {}, figures, out)
        write_atomic(out / WORLD_TABLE, table.to_csv(index=False))
        write_atomic(out / RESULTS, found.model_dump_json(indent=2) + "\n")
    return found


def merged(folders: Sequence[Path]) -> Bench:
    """The results in folders as one bench, with pairs of all entrants.

    Levels are in the order of the ladder, and other sets follow.

    Raises:
        RunError: A folder has no results, or two have different worlds of a set, or
            different files under one name.
    """
    found = [read(folder) for folder in folders]
    if len(found) == 1:
        return found[0]
    sets = _same_sets(folders, found)
    rows: dict[tuple[str, str], BenchRow] = {}
    driven: dict[str, dict[str, Driven]] = {name: {} for name in sets}
    for folder, each in zip(folders, found, strict=True):
        table = _table(folder)
        for row in each.rows:
            key = row.set, row.entrant
            if key in rows and rows[key].files != row.files:
                raise RunError(
                    f"{folder / RESULTS}: {row.entrant!r} on {row.set} is not that of "
                    "the earlier folders; rename one (NAME=FILE)"
                )
            if key in rows and row.time is None:
                continue  # its episodes are in an earlier folder
            rows[key] = row
            if row.time is not None and row.kind != "privileged":
                driven[row.set][row.entrant] = _driven(table, row)
    both = {name: list(each.values()) for name, each in driven.items()}
    order = list(sets)
    return Bench(
        versions=found[0].versions,
        sets=tuple(sets.values()),
        entrants=tuple(dict.fromkeys(row.entrant for row in rows.values())),
        rows=tuple(sorted(rows.values(), key=lambda row: order.index(row.set))),
        overall=overall_of(both) if len(both) > 1 else (),
        pairs=pairs_of(both),
    )


def read(folder: Path) -> Bench:
    """The results in a folder.

    Raises:
        RunError: There are none, or they cannot be read.
    """
    if not (folder / RESULTS).is_file() and (folder / LOCK_FILE).exists():
        raise RunError(f"the bench in {folder} is not finished: repeat its command")
    try:
        return Bench.model_validate_json(read_file(folder / RESULTS, RECORD_BYTES))
    except (OSError, ValueError) as error:
        raise RunError(f"{folder / RESULTS}: {one_line_reason(error)}") from error


def _same_sets(folders: Sequence[Path], found: Sequence[Bench]) -> dict[str, BenchSet]:
    """The sets of all benches, by name.

    Raises:
        RunError: Worlds differ.
    """
    sets: dict[str, BenchSet] = {}
    for folder, each in zip(folders, found, strict=True):
        for own in each.sets:
            before = sets.setdefault(own.name, own)
            for key, what in _COMPARED.items():
                one, other = getattr(before, key), getattr(own, key)
                if one == other:
                    continue
                raise RunError(
                    f"{folder / RESULTS}: the set {own.name!r} differs from that of "
                    f"the earlier folders in its {what} ({_short(other)}, not "
                    f"{_short(one)}); show them one at a time"
                )
            if not own.dynamics:
                sets[own.name] = own  # says that results of before are among them
    levels = [name for name in set_names() if name in sets]
    return {name: sets[name] for name in dict.fromkeys([*levels, *sets])}


def _short(value: object) -> str:
    return (value[:8] or "unknown") if isinstance(value, str) else str(value)


def _table(folder: Path) -> pd.DataFrame:
    file = folder / WORLD_TABLE
    try:
        return read_worlds(file)
    except ValueError as error:
        raise RunError(f"{file}: {one_line_reason(error)}") from error
    except OSError as error:
        raise RunError(
            f"{folder / WORLD_TABLE}: {one_line_reason(error)}; results on sealed "
            "worlds cannot be compared with others (tdac bench reveal)"
        ) from error


def _driven(table: pd.DataFrame, row: BenchRow) -> Driven:
    own = table[(table["set"] == row.set) & (table["entrant"] == row.entrant)]
    time, success = (
        own.pivot_table(index="file", columns="index", values=name).to_numpy(np.float64)
        for name in ("time_score", "success")
    )
    # Several runs on each world follow one another.
    shape = -1, row.worlds
    return Driven(row.entrant, time.reshape(shape), success.reshape(shape))


def reveal(folder: Path, salt_file: Path) -> None:
    """Publishes the hidden worlds of a bench: their salt, and all episodes.

    Raises:
        RunError: There are no results, they are not of hidden worlds, or episodes are
            missing.
        TaskError: The file has no valid salt, or the wrong one.
    """
    found, sha256 = read(folder), sha256_of(read_salt(salt_file))
    for own in found.sets:
        if own.salt_sha256 is None:
            raise RunError(f"{folder / RESULTS}: the worlds of {own.name} are public")
        if own.salt_sha256 != sha256:
            raise TaskError(f"{salt_file} is not the salt of {folder / RESULTS}")
    rows = [
        line
        for row in found.rows
        if row.time is not None
        for line in world_rows(
            row.set,
            row.entrant,
            [
                sealed_episodes(
                    folder_of(folder / SEALED, row.set, file.sha256), file.sha256
                )
                for file in row.files
            ],
        )
    ]
    publish(folder, rows, salt_file)
    draw_figures(found, pd.DataFrame(rows), folder)
