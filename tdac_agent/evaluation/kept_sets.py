"""What an evaluation on a task set leaves in a folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tdac_agent.evaluation.set_report import SetReport
from tdac_agent.storage.files import write_atomic
from tdac_agent.verification.judge.set_job import WorldEpisode

REPORT_FILE = "set.json"
SEALED, ROWS_FILE = "sealed", "episodes.jsonl"
TRAJECTORIES = "trajectories"


def keep_report(report: SetReport, out: Path) -> None:
    """Writes `set.json`."""
    out.mkdir(parents=True, exist_ok=True)
    write_atomic(out / REPORT_FILE, report.model_dump_json(indent=2) + "\n")


def keep_trajectories(trajectories: Path | None, out: Path) -> None:
    """Copies the trajectories of public worlds to `trajectories/`."""
    if trajectories is None or not trajectories.is_dir():
        return
    kept = out / TRAJECTORIES
    kept.mkdir(exist_ok=True)
    for path in sorted(trajectories.iterdir()):
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
