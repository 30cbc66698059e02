"""The ledger of hidden evaluations: an append-only file of the user.

Before hidden worlds are driven, a line says which controller is judged on which set,
with which salt and how many worlds, and by which run it was written. After that, a
line has the report. An evaluation
that is in the ledger is answered from it.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from tdac_agent.storage.journal import append_record, read_records, repair_end
from tdac_agent.storage.locks import wait_for
from tdac_agent.verification.episode_report import EpisodeReport, HiddenCount
from tdac_envs.core.errors import TaskError, one_line_reason
from tdac_envs.core.trusted_folders import user_state

SEQUENTIAL: Literal["sequential"] = "sequential"


class HiddenEvaluation(BaseModel):
    """What is evaluated; two with equal values have equal episodes."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    entrant: str = Field(description="SHA-256 of the controller file.")
    set: str = Field(description="Name of the set.")
    set_sha256: str
    dynamics: str = Field(
        "", description="Hash of the set with its code; empty before Ladder 1.0."
    )
    worlds: int | Literal["sequential"]
    salt_sha256: str


class _Line(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)

    schema_version: Literal[1] = 1
    id: str = Field(description="Common to the lines of one evaluation.")
    time: str = Field(description="UTC.")


class _Begun(_Line):
    event: Literal["begun"] = "begun"
    about: HiddenEvaluation
    lineage: str | None = Field(None, description="Id of the run that wrote the file.")


class _Ended(_Line):
    event: Literal["ended"] = "ended"
    worlds: int = Field(description="Episodes; 0 if the tests refused the controller.")
    report: str = Field(description="The report as JSON; its count is not in it.")


@dataclass(frozen=True, slots=True)
class Ledger:
    """The ledger in a file.

    Attributes:
        path: The file; it and its folder are made when they are needed.
    """

    path: Path

    def recorded(self, about: HiddenEvaluation) -> EpisodeReport | None:
        """The report of an evaluation that has ended, with its count; None without.

        Raises:
            TaskError: The ledger cannot be read, or has a report that cannot.
        """
        begun, ended = self._lines()
        for line in begun:
            end = ended.get(line.id)
            if line.about == about and end is not None:
                count = _count(begun, about, end.time)
                try:
                    report = EpisodeReport.model_validate_json(end.report)
                    return report.model_copy(update={"hidden": count})
                except ValidationError:
                    raise TaskError(
                        f"{self.path}: the report of {end.time} cannot be read by this "
                        "version of tdac; evaluate with another salt"
                    ) from None
        return None

    def begin(self, about: HiddenEvaluation, lineage: str | None = None) -> str:
        """Records that an evaluation begins; returns the id of its lines.

        Args:
            about: What is evaluated.
            lineage: Id of the run that wrote the controller, if one did.

        Raises:
            TaskError: The ledger cannot be written.
        """
        number = secrets.token_hex(8)
        self._append(_Begun(id=number, time=_now(), about=about, lineage=lineage))
        return number

    def end(
        self, number: str, about: HiddenEvaluation, report: EpisodeReport
    ) -> EpisodeReport:
        """Records the report of an evaluation; returns it with its count.

        Raises:
            TaskError: The ledger cannot be written.
        """
        text = report.model_dump_json(exclude={"hidden"})
        self._append(_Ended(id=number, time=_now(), worlds=report.count, report=text))
        if report.refused:
            return report
        count = _count(self._lines()[0], about, None)
        return report.model_copy(update={"hidden": count})

    def _append(self, line: _Line) -> None:
        with self._usable(), wait_for(self.path.with_suffix(".lock")):
            repair_end(self.path)
            append_record(self.path, line.model_dump(mode="json"))

    def _lines(self) -> tuple[list[_Begun], dict[str, _Ended]]:
        """What has begun, in order, and what has ended, by id; not what was refused."""
        with self._usable():
            records = read_records(self.path)
            begun = [_Begun(**each) for each in records if each.get("event") == "begun"]
            ends = [_Ended(**each) for each in records if each.get("event") == "ended"]
        refused = {end.id for end in ends if not end.worlds}
        begun = [each for each in begun if each.id not in refused]
        return begun, {end.id: end for end in ends if end.id not in refused}

    @contextmanager
    def _usable(self) -> Generator[None]:
        try:
            self.path.parent.mkdir(0o700, parents=True, exist_ok=True)
            yield
        except OSError as error:
            why = one_line_reason(error)
        except ValidationError:
            why = "a line in it cannot be read by this version of tdac"
        else:
            return
        raise TaskError(f"the ledger of hidden evaluations, {self.path}: {why}")


def user_ledger() -> Ledger:
    """The ledger of this user.

    Raises:
        TaskError: The user has no home folder.
    """
    folder = user_state()
    if folder is None:
        raise TaskError(
            "hidden evaluations are recorded in a ledger, but there is no home folder; "
            "set XDG_STATE_HOME to a folder"
        )
    return Ledger(folder / "tdac" / "hidden-evaluations.jsonl")


def on_record(
    about: HiddenEvaluation, lineage: str | None, drive: Callable[[], EpisodeReport]
) -> EpisodeReport:
    """The report of a hidden evaluation, which is recorded before it is driven.

    Args:
        about: What is evaluated. If it is recorded already, nothing is driven.
        lineage: Id of the run that wrote the controller, if one did.
        drive: Drives it.

    Raises:
        TaskError: The ledger cannot be used.
    """
    ledger = user_ledger()
    report = ledger.recorded(about)
    if report is None:
        number = ledger.begin(about, lineage)
        report = ledger.end(number, about, drive())
    return report


def _count(
    begun: Sequence[_Begun], about: HiddenEvaluation, recorded: str | None
) -> HiddenCount:
    """The place of an evaluation among all of its controller on sets of this name."""
    on_set = [each for each in begun if each.about.set == about.set]
    own = _different(each for each in on_set if each.about.entrant == about.entrant)
    runs = {each.lineage for each in on_set if each.about == about} - {None}
    related = _different(each for each in on_set if each.lineage in runs)
    return HiddenCount(
        number=own.index(about) + 1,
        count=len(own),
        lineage=len(related) or None,
        recorded=recorded,
    )


def _different(begun: Iterable[_Begun]) -> list[HiddenEvaluation]:
    """Evaluations that differ; one that was interrupted and driven again is one."""
    return list(dict.fromkeys(each.about for each in begun))


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
