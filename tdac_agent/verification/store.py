"""What driving many episodes leaves in a folder."""

from __future__ import annotations

import contextlib
import hmac
import json
import shutil
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.tasks.installation import keyed, lasting_secret
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
MARK = ".mark"
WRITTEN = REPORT_FILE, UNFINISHED, TRAJECTORIES, SEALED
_MOST_BYTES = 512 << 20


def keep_report(report: EpisodeReport, out: Path) -> None:
    """Writes `episodes.json`."""
    out.mkdir(parents=True, exist_ok=True)
    _write_marked(out / REPORT_FILE, report.model_dump_json(indent=2) + "\n")


def _write_marked(path: Path, text: str) -> None:
    """Writes a file, and beside it the mark that it was written here."""
    write_atomic(path, text)
    write_atomic(path.with_suffix(MARK), _mark(b"file", text.encode()))


def is_marked(path: Path, *, hidden: bool = False) -> bool:
    """Whether a file is as this installation wrote it.

    Where no secret can be kept, only results on hidden worlds are distrusted.

    Args:
        path: The file.
        hidden: Whether it has results on hidden worlds.
    """
    if lasting_secret() is None:
        return not hidden
    try:
        content = read_file(path, _MOST_BYTES)
        known = read_file(path.with_suffix(MARK), TEXT_BYTES)
    except (OSError, ValueError):
        return False
    return hmac.compare_digest(known, _mark(b"file", content).encode())


def _mark(*parts: bytes) -> str:
    """A mark that only this installation can make; empty without a secret."""
    if lasting_secret() is None:
        return ""
    hashes = [sha256_of(part).encode() for part in parts]
    return keyed(b"kept|" + b"|".join(hashes)).hex()


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
    _forget_unmarked(folder, text.encode())
    yield folder
    shutil.rmtree(folder)


def mark_rows(folder: Path) -> None:
    """Marks the rows of an unfinished call; those without a mark are driven again."""
    rows, about = folder / ROWS_FILE, read_file(folder / ABOUT, TEXT_BYTES)
    content = read_file(rows, _MOST_BYTES) if rows.is_file() else b""
    whole = content[: content.rfind(b"\n") + 1]
    text = f"{len(whole)} {_mark(about, whole)}"
    write_atomic(rows.with_suffix(MARK), text, lasting=False)


def _forget_unmarked(folder: Path, about: bytes) -> None:
    """Cuts off the rows that this installation did not write."""
    rows = folder / ROWS_FILE
    if not rows.is_file() or lasting_secret() is None:
        return
    content, size = read_file(rows, _MOST_BYTES), 0
    with contextlib.suppress(OSError, ValueError):
        written = read_file(rows.with_suffix(MARK), TEXT_BYTES).decode()
        number, _, mark = written.partition(" ")
        own = _mark(about, content[: int(number)])
        if hmac.compare_digest(mark.encode(), own.encode()):
            size = int(number)
    write_atomic(rows, content[:size])


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
    hidden = report is not None and report.provenance.salt_sha256 is not None
    if report is None or not is_marked(folder / REPORT_FILE, hidden=hidden):
        return None
    own, same = report.provenance, is_about(report, wanted)
    driven = [each.number for each in report.episodes]
    whole = driven == list(numbers) or (
        own.salt_sha256 is not None and report.count == len(numbers)
    )
    return report if same and (report.refused or whole) else None


def is_about(report: EpisodeReport, wanted: dict[str, Any]) -> bool:
    """Whether a report has these fields of provenance, and these versions of packages.

    Args:
        report: The report.
        wanted: Fields of its provenance, with their values.
    """
    own = report.provenance
    return own.versions == dict(versions()) and all(
        getattr(own, name) == value for name, value in wanted.items()
    )


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
    _write_marked(folder / ROWS_FILE, rows)
