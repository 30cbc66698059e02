"""Jobs for the judge's process, and its findings."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final, Literal

from pydantic import BaseModel, ConfigDict, Field

from tdac_agent.sandbox import Limits
from tdac_agent.storage.printable_record import PrintableRecord
from tdac_agent.tasks.task_file import Profile
from tdac_agent.verification.diagnosis.report import Episode, SecondOpinion
from tdac_envs.physics.moved import EXACT

SUITE: Final = "suite"
"""The kind of a `Job`."""


class Job(BaseModel):
    """A suite to run on a controller; all paths are absolute.

    With `set_file`, the suite has tests of a task set, whose first world of `split` is
    there instead of a task. Static and contract tests come first.
    """

    model_config = ConfigDict(extra="forbid")

    kind: Literal["suite"] = SUITE
    task: Path = Field(description="Folder of what the controller may read.")
    controller: Path
    suites: list[Path] = Field(description="In the order in which they run.")
    profile: Profile
    paper: bool
    tier: str
    seed: int
    limits: Limits
    out: Path
    trajectories: Path | None = Field(description="Folder; None to discard them.")
    metres: bool = Field(False, description="Whether the user reads metres of the map.")
    set_file: Path | None = None
    split: str = ""
    physics: str = Field(
        EXACT, description="What drives again what reached the goal; `exact`: nothing."
    )


def write_job(job: BaseModel, path: Path) -> None:
    """Writes a job as JSON; paths may contain bytes that are not UTF-8."""
    path.write_text(json.dumps(job.model_dump(mode="json")), encoding="utf-8")


class Findings(PrintableRecord):
    """What the judge's process found, in addition to pytest's report log."""

    model_config = ConfigDict(extra="forbid")

    expected: list[str]
    episodes: list[Episode]
    diagnoses: dict[str, str]
    shown: dict[str, str] = Field(
        default_factory=dict, description="Texts of diagnoses in the user's units."
    )
    tier: str
    child_cpu_seconds: float
    fault: str | None
    checks: dict[str, str | None] = Field(
        default_factory=dict,
        description="Static and contract tests on a set: why each failed, or None.",
    )
    second_opinion: SecondOpinion | None = None
