"""What driving many episodes leaves in a folder."""

from __future__ import annotations

import json
import shutil
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tdac_agent.storage.files import write_atomic
from tdac_agent.tasks.provenance import versions
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.judge.episode_row import EpisodeRow
from tdac_agent.verification.salt import SEALED
from tdac_envs.core.intake import TEXT_BYTES, read_file

REPORT_FILE = "episodes.json"
EARLIER_FILES = ("set.json", "robust.json")
"""What earlier versions called it."""
ROWS_FILE = "episodes.jsonl"
TRAJECTORIES = "trajectories"
UNFINISHED, ABOUT = "unfinished", "about.json"
WRITTEN = REPORT_FILE, UNFINISHED, TRAJECTORIES, SEALED
_MOST_BYTES = 512 << 20


def keep_report(report: EpisodeReport, out: Path) -> None:
    """Writes `episodes.json`."""
    out.mkdir(parents=True, exist_ok=True)
    write_atomic(out / REPORT_FILE, report.model_dump_json(indent=2) + "\n")


def read_report(folder: Path) -> EpisodeReport | None:
    """The report in a folder, also of an earlier version; None if there is none."""
    names = (REPORT_FILE, *EARLIER_FILES)
    path = next((folder / each for each in names if (folder / each).is_file()), None)
    try:
        data = b"" if path is None else read_file(path, _MOST_BYTES)
        return EpisodeReport.model_validate_json(data)
    except (OSError, ValueError):
        return None


@contextmanager
def unfinished(out: Path | None, about: dict[str, Any]) -> Generator[Path | None]:
    """The folder of what an interrupted call has driven; removed at the end.

    Args:
        out: Folder of the results; None for none.
        about: What determines the episodes. What others have driven is removed.
    """
    if out is None:
        yield None
        return
    folder, text = out / UNFINISHED, json.dumps(about, sort_keys=True)
    try:
        same = read_file(folder / ABOUT, TEXT_BYTES) == text.encode()
    except (OSError, ValueError):
        same = False
    if not same:
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        folder.chmod(0o700)
        write_atomic(folder / ABOUT, text)
    yield folder
    shutil.rmtree(folder)


def kept_report(
    folder: Path, wanted: dict[str, Any], numbers: Sequence[int]
) -> EpisodeReport | None:
    """The report in a folder if it is the wanted one, by these versions of packages.

    Args:
        folder: The folder.
        wanted: Fields of its provenance, with their values.
        numbers: Numbers of the episodes; those of hidden worlds are only counted.
    """
    report = read_report(folder)
    if report is None:
        return None
    own = report.provenance
    same = own.versions == dict(versions()) and all(
        getattr(own, name) == value for name, value in wanted.items()
    )
    driven = [each.number for each in report.episodes]
    whole = driven == list(numbers) or (
        own.salt_sha256 is not None and report.count == len(numbers)
    )
    return report if same and (report.refused or whole) else None


def count_unfinished(out: Path) -> int:
    """Number of finished episodes that an interrupted call left below a folder."""
    files = out.glob(f"**/{UNFINISHED}/{ROWS_FILE}")
    return sum(len(read_file(file, _MOST_BYTES).splitlines()) for file in files)


def keep_trajectories(trajectories: Path | None, out: Path) -> None:
    """Copies the trajectories of public worlds to `trajectories/`."""
    if trajectories is None or not trajectories.is_dir():
        return
    kept = out / TRAJECTORIES
    kept.mkdir(exist_ok=True)
    for path in sorted(trajectories.iterdir()):
        write_atomic(kept / path.name, read_file(path, _MOST_BYTES), lasting=False)


def keep_sealed(episodes: Sequence[EpisodeRow], out: Path) -> None:
    """Writes the figures of hidden worlds to `sealed/`, which only this user can open.

    They must not be shown to whoever writes controllers, as long as the salt is secret.
    """
    if not episodes:
        return
    folder = out / SEALED
    folder.mkdir(0o700, parents=True, exist_ok=True)
    folder.chmod(0o700)
    rows = "".join(f"{episode.model_dump_json()}\n" for episode in episodes)
    write_atomic(folder / ROWS_FILE, rows)
