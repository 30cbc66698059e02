"""The one evaluation of a selected controller on hidden worlds, with a fresh salt."""

from __future__ import annotations

from pathlib import Path

from pydantic import ValidationError

from tdac_agent.runs.recorder import Recorder
from tdac_agent.runs.selection_record import HIDDEN_FILE
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.salt import SEALED, drawn_salt
from tdac_agent.verification.verify_episodes import verify_episodes
from tdac_envs.core.intake import RECORD_BYTES, parse_json, read_file
from tdac_envs.ladder.task_sets import TaskSet


def verify_hidden(
    tasks: TaskSet, recorder: Recorder, source: str, judge: WarmJudge, tier: str
) -> EpisodeReport:
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
    about = {"controller_sha256": sha256_of(raw), "sha256": tasks.sha256}
    recorder.event("hidden.start", **about)
    known = recorder.vouches(folder / HIDDEN_FILE)
    report = _recorded(folder / HIDDEN_FILE, about) if known else None
    if report is None:
        report = verify_episodes(
            raw,
            tasks,
            split="hidden",
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
        write_atomic(folder / HIDDEN_FILE, report.model_dump_json(indent=2) + "\n")
        recorder.vouch(folder / HIDDEN_FILE)
    recorder.event("hidden.end", passed=report.passed, worlds=report.count, **about)
    return report


def _recorded(path: Path, about: dict[str, str]) -> EpisodeReport | None:
    try:
        report = EpisodeReport.model_validate(parse_json(read_file(path, RECORD_BYTES)))
    except (OSError, ValueError, ValidationError):
        return None
    known = report.provenance
    same = all(getattr(known, name) == value for name, value in about.items())
    return report if same and known.split == "hidden" else None
