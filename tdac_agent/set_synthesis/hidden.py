"""The one evaluation of a selected controller on hidden worlds, with a fresh salt."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

from pydantic import ValidationError

from tdac_agent.evaluation.set_report import SetReport
from tdac_agent.evaluation.set_verify import verify_on_set
from tdac_agent.runs.recorder import Recorder
from tdac_agent.storage.files import write_atomic
from tdac_agent.tasks.provenance import sha256_of
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_envs.core.intake import RECORD_BYTES, parse_json, read_file
from tdac_envs.ladder.task_sets import TaskSet

SEALED = "sealed"
"""Subfolder of a run that only its user can read: the salt of the hidden worlds."""
SALT_FILE = "salt"
SALT_BYTES = 32
HIDDEN_REPORT = "hidden.json"


def verify_hidden(
    tasks: TaskSet, recorder: Recorder, source: str, judge: WarmJudge, tier: str
) -> SetReport:
    """The verdict of a sequential test on hidden worlds; the recorded one, if any.

    The controller and the set are on record before the salt is drawn.

    Args:
        tasks: The task set.
        recorder: Records the run.
        source: Source of the selected controller.
        judge: A warm judge.
        tier: Sandbox tier.
    """
    folder, raw = recorder.run.folder, source.encode("utf-8", "surrogatepass")
    about = {"controller_sha256": sha256_of(raw), "set_sha256": tasks.sha256}
    recorder.event("hidden.start", **about)
    report = _recorded(folder / HIDDEN_REPORT, about) if recorder.run.mark else None
    if report is None:
        report = verify_on_set(
            raw,
            tasks,
            "hidden",
            # A salt in a folder from elsewhere may be known.
            salt_file=drawn_salt(folder / SEALED, reuse=bool(recorder.run.mark)),
            lineage=recorder.run.id,
            tier=tier,
            judge=judge,
            watch=lambda done, reached: recorder.tell(
                {"event": "drive.step", "what": "hidden", "done": done}
                | {"reached": reached}
            ),
        )
        write_atomic(folder / HIDDEN_REPORT, report.model_dump_json(indent=2) + "\n")
    recorder.event("hidden.end", passed=report.passed, worlds=report.worlds, **about)
    return report


def drawn_salt(folder: Path, *, reuse: bool) -> Path:
    """The file with the salt of a run, 0600 in a folder 0700.

    Args:
        folder: Its folder, which is made.
        reuse: Whether a salt that an interrupted process drew is used.
    """
    folder.mkdir(mode=0o700, exist_ok=True)
    folder.chmod(0o700)
    path = folder / SALT_FILE
    if not (reuse and path.exists()):
        unfinished = folder / f"{SALT_FILE}.new"
        handle = os.open(unfinished, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        with os.fdopen(handle, "wb") as file:
            file.write(secrets.token_bytes(SALT_BYTES))
            file.flush()
            os.fsync(handle)
        unfinished.rename(path)
    return path


def _recorded(path: Path, about: dict[str, str]) -> SetReport | None:
    try:
        report = SetReport.model_validate(parse_json(read_file(path, RECORD_BYTES)))
    except (OSError, ValueError, ValidationError):
        return None
    known = report.provenance
    same = all(getattr(known, name) == value for name, value in about.items())
    return report if same and known.split == "hidden" else None
