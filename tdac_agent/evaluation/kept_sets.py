"""What an evaluation on a task set leaves in a folder."""

from __future__ import annotations

import json
import shutil
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tdac_agent.evaluation.salt import SEALED
from tdac_agent.evaluation.set_report import SetReport
from tdac_agent.storage.files import write_atomic
from tdac_agent.tasks.provenance import versions
from tdac_agent.verification.judge.set_job import WorldEpisode
from tdac_envs.core.intake import TEXT_BYTES, read_file

REPORT_FILE = "set.json"
ROWS_FILE = "episodes.jsonl"
TRAJECTORIES = "trajectories"
UNFINISHED, ABOUT = "unfinished", "about.json"
_MOST_BYTES = 512 << 20


def keep_report(report: SetReport, out: Path) -> None:
    """Writes `set.json`."""
    out.mkdir(parents=True, exist_ok=True)
    write_atomic(out / REPORT_FILE, report.model_dump_json(indent=2) + "\n")


@contextmanager
def unfinished(out: Path | None, about: dict[str, Any]) -> Generator[Path | None]:
    """The folder of what an interrupted evaluation has driven; removed at the end.

    Args:
        out: Folder of the evaluation; None for none.
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
    folder: Path,
    sha256: str,
    set_sha256: str,
    split: str,
    worlds: int,
    salt_sha256: str | None = None,
) -> SetReport | None:
    """The report in a folder, if it is the wanted one, by these versions of packages.

    Args:
        folder: The folder.
        sha256: Hash of the policy's file.
        set_sha256: Hash of the set.
        split: Split of the worlds.
        worlds: Their number.
        salt_sha256: Hash of the salt of hidden worlds.
    """
    try:
        data = read_file(folder / REPORT_FILE, _MOST_BYTES)
        report = SetReport.model_validate_json(data)
    except (OSError, ValueError):
        return None
    own, now = report.provenance, dict(versions())
    found = own.controller_sha256, own.set_sha256, own.split, own.salt_sha256
    if (*found, own.versions) != (sha256, set_sha256, split, salt_sha256, now):
        return None
    return report if report.refused or report.worlds == worlds else None


def keep_trajectories(trajectories: Path | None, out: Path) -> None:
    """Copies the trajectories of public worlds to `trajectories/`."""
    if trajectories is None or not trajectories.is_dir():
        return
    kept = out / TRAJECTORIES
    kept.mkdir(exist_ok=True)
    for path in sorted(trajectories.iterdir()):
        # raw read: our temporary folder
        write_atomic(kept / path.name, path.read_bytes())


def keep_sealed(episodes: Sequence[WorldEpisode], out: Path) -> None:
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
