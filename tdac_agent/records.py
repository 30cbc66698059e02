"""A run on disk: everything that happened, in one self-contained folder."""

from __future__ import annotations

import difflib
import json
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from tdac_agent.errors import RunError
from tdac_agent.files import append_line, write_atomic
from tdac_agent.provider import Reply, Request
from tdac_agent.report import Report
from tdac_agent.retry import Missed
from tdac_agent.rules import RuleBook
from tdac_agent.task import Task, portable_task_file, write_workdir

Status = Literal["running", "verified", "not verified", "interrupted", "fault"]
OWN_SUITE = "suite"
RULES_FILE = "rules.json"
Event = Callable[[dict[str, Any]], None]


class Attempt(BaseModel):
    """One candidate (k, j)."""

    model_config = ConfigDict(extra="forbid")

    k: int
    j: int
    valid: bool = Field(description="False where the model gave no code.")
    passed: bool
    failed_tests: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


class Run(BaseModel):
    """`run.json`: one synthesis."""

    model_config = ConfigDict(extra="forbid")

    schema_version: Literal[1] = 1
    folder: Path = Field(exclude=True)
    task: str
    task_sha256: str
    learner: str
    optimizer: str
    iterations: int = Field(description="K")
    patience: int = Field(description="J")
    seed: int
    status: Status = "running"
    tau: int | None = Field(None, description="Iteration k of the first success.")
    attempts: list[Attempt] = []
    tokens_in: int = 0
    tokens_out: int = 0
    tokens_cached: int = Field(0, description="Of tokens_in, read from a cache.")
    models: tuple[str, ...] = Field((), description="As the providers report them.")
    base_url: str | None = None
    prompt: str = Field("full", description="Template of the first question.")
    started: str
    seconds: float = 0.0

    @property
    def verified(self) -> bool:
        """Whether a controller passed."""
        return self.status == "verified"

    @property
    def controller(self) -> Path:
        """Path of the verified controller."""
        return self.folder / "controller.py"


def load_run(folder: Path) -> Run:
    """Reads a run folder.

    Raises:
        RunError: It holds no readable `run.json`.
    """
    path = folder / "run.json"
    try:
        content = json.loads(path.read_bytes().decode("utf-8"))
        return Run.model_validate({**content, "folder": folder})
    # Not all of a damaged file is a JSONDecodeError: wrong encodings, endless numbers
    # and deep nesting are not. A ValidationError is a ValueError.
    except (OSError, ValueError, TypeError, RecursionError) as error:
        reason = str(error).partition("\n")[0]
        raise RunError(f"{folder} is not a run folder: {reason}") from error


def load_rules(folder: Path) -> RuleBook:
    """The rules of a run folder; none where no iteration came to an end.

    Raises:
        RunError: Their file is damaged.
    """
    path = folder / RULES_FILE
    try:
        return RuleBook.model_validate_json(path.read_bytes())
    except FileNotFoundError:
        return RuleBook()
    except (OSError, ValueError) as error:
        reason = str(error).partition("\n")[0]
        raise RunError(f"{path} holds no rules: {reason}") from error


@dataclass(slots=True)
class Recorder:
    """Writes a run folder while the run goes on.

    Attributes:
        run: The record so far.
        on_event: Called with each journal record, for live progress.
    """

    run: Run
    on_event: Event | None
    _clock: float = field(default_factory=time.monotonic)
    _previous: str = ""

    def start(self, task: Task) -> None:
        """Makes the folder: task, original, suite, working files, empty journal."""
        folder = self.run.folder
        write_workdir(folder, task)
        write_atomic(
            folder / "task.yaml", portable_task_file(task, own_suite=OWN_SUITE)
        )
        if task.suite is not None:
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(task.suite, folder / OWN_SUITE, ignore=ignored)
        original = task.setting.original
        if original is not None:
            write_atomic(folder / original.name, original.file.read_bytes())
        self.event("run.start", task=task.name, learner=self.run.learner)
        self.save()

    def event(self, name: str, /, **facts: Any) -> None:
        """Appends to the journal."""
        record = {"event": name, "seconds": round(self._elapsed(), 3), **facts}
        append_line(self.run.folder / "journal.jsonl", record)
        if self.on_event is not None:
            self.on_event(record)

    def asked(self, request: Request, model: str) -> None:
        """Keeps a prompt before it is sent to a model."""
        _, k, j = request.sample
        write_atomic(self._unused(request, "prompt"), request.prompt)
        self.event("call.intent", kind=request.kind, k=k, j=j, model=model)

    def missed(self, request: Request, miss: Missed) -> None:
        """Keeps a fault, and whether the question is put again."""
        _, k, j = request.sample
        wait = None if miss.wait is None else round(miss.wait, 3)
        self.event(
            "call.fault",
            kind=request.kind,
            k=k,
            j=j,
            attempt=miss.attempt,
            fault=miss.fault.kind,
            reason=str(miss.fault),
            wait=wait,
        )

    def answered(self, request: Request, reply: Reply) -> None:
        """Keeps an answer as it came, beside earlier ones to the same prompt."""
        _, k, j = request.sample
        write_atomic(self._unused(request, "reply"), reply.text)
        self.run.tokens_in += reply.tokens_in
        self.run.tokens_out += reply.tokens_out
        self.run.tokens_cached += reply.tokens_cached
        if reply.model is not None and reply.model not in self.run.models:
            self.run.models = (*self.run.models, reply.model)
        self.event(
            "call.reply",
            kind=request.kind,
            k=k,
            j=j,
            stop=reply.stop,
            tokens_in=reply.tokens_in,
            tokens_out=reply.tokens_out,
            tokens_cached=reply.tokens_cached,
            tokens_written=reply.tokens_written,
            model=reply.model,
            request_id=reply.request_id,
            notes=list(reply.notes),
        )

    def candidate(self, k: int, j: int, source: str) -> Path:
        """Keeps a candidate's source and its difference from the last one."""
        folder = self._folder(k, j)
        write_atomic(folder / "controller.py", source)
        difference = difflib.unified_diff(
            self._previous.splitlines(keepends=True),
            source.splitlines(keepends=True),
            "previous",
            "controller.py",
        )
        write_atomic(folder / "controller.diff", "".join(difference))
        self._previous = source
        self.event("verify.start", k=k, j=j)
        return folder

    def judged(
        self, k: int, j: int, report: Report | None, notes: tuple[str, ...]
    ) -> None:
        """Keeps a candidate's report; None where the model gave no code."""
        failed = () if report is None else tuple(f.test for f in report.failures)
        passed = report is not None and report.passed
        attempt = Attempt(
            k=k,
            j=j,
            valid=report is not None,
            passed=passed,
            failed_tests=failed,
            notes=notes,
        )
        self.run.attempts.append(attempt)
        self.event("verify.end", **attempt.model_dump(mode="json"))
        self.save()

    def rules(self, k: int, book: RuleBook, notes: tuple[str, ...] = ()) -> None:
        """Keeps the rules of the run, and what changed them in iteration k."""
        rules = [rule.model_dump(mode="json") for rule in book.in_force]
        self.event("rules", k=k, rules=rules, notes=list(notes))
        text = book.model_dump_json(indent=2) + "\n"
        write_atomic(self.run.folder / RULES_FILE, text)

    def finish(self, status: Status, **facts: Any) -> None:
        """Closes the run."""
        self.run.status = status
        self.event("run.end", status=status, **facts)
        self.save()

    def save(self) -> None:
        """Writes `run.json`."""
        self.run.seconds = round(self._elapsed(), 3)
        write_atomic(
            self.run.folder / "run.json", self.run.model_dump_json(indent=2) + "\n"
        )

    def _unused(self, request: Request, what: str) -> Path:
        """`edit.reply.md`, or `edit.reply-2.md` where that is there already."""
        _, k, j = request.sample
        folder = self._folder(k, j)
        path, number = folder / f"{request.kind}.{what}.md", 1
        while path.exists():
            number += 1
            path = folder / f"{request.kind}.{what}-{number}.md"
        return path

    def _folder(self, k: int, j: int) -> Path:
        folder = self.run.folder / "iterations" / f"k{k:02d}" / f"j{j}"
        folder.mkdir(parents=True, exist_ok=True)
        return folder

    def _elapsed(self) -> float:
        return time.monotonic() - self._clock
