"""Writes a run folder: each step when it happens."""

from __future__ import annotations

import difflib
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from tdac_agent.models.budget import Amount, Enough
from tdac_agent.models.provider import Reply, Request
from tdac_agent.models.retry import FailedCall
from tdac_agent.problems.problem import Problem
from tdac_agent.prompting.prompt import PromptTemplate
from tdac_agent.prompting.rules import RuleBook
from tdac_agent.runs.journal_state import REPEATED, JournalState, reply_of
from tdac_agent.runs.mark import Files, MarkedJournal, files_of, mark_of
from tdac_agent.runs.ownership import suite_in
from tdac_agent.runs.run_record import (
    GIVEN_FILE,
    GIVEN_RULES_FILE,
    PROMPT_FILE,
    RULES_FILE,
    RUN_FILE,
    Attempt,
    Run,
    Status,
    call_file,
    candidate_at,
)
from tdac_agent.storage.blobs import Blobs
from tdac_agent.storage.files import write_atomic, write_if_changed
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.tasks.installation import lasting_secret
from tdac_agent.tasks.task_file import OWN_SUITE

MOST_LINES = 5000
"""Longest source that is diffed; the time grows with the square of the length."""
Event = Callable[[dict[str, Any]], None]


@dataclass(slots=True)
class Recorder:
    """Writes a run folder while the run goes on.

    A resumed run repeats all of its steps; those on record are passed to `on_event`,
    but not written again.

    Attributes:
        run: The record so far.
        past: What earlier processes have recorded.
        on_event: Called with each journal record, for live progress.
    """

    run: Run
    past: JournalState = field(default_factory=JournalState)
    on_event: Event | None = None
    _before: Run | None = None
    _clock: float = field(default_factory=time.monotonic)
    _previous: str = ""
    _turns: Counter[tuple[str, int, int]] = field(default_factory=Counter)
    _asked: Counter[str] = field(default_factory=Counter)
    _files: Files = field(default_factory=Files)
    _journal: MarkedJournal = field(init=False)

    def __post_init__(self) -> None:
        """Reads what the journal has already."""
        self._journal = MarkedJournal.of(self.run)

    def begin(
        self,
        problem: Problem,
        template: PromptTemplate,
        given: str | None,
        **facts: Any,
    ) -> None:
        """Writes the files of a new run, and begins the journal.

        Args:
            problem: What the controller is for.
            template: Template of the first question; a copy is kept unless shipped.
            given: Source of an initial controller, if there is one.
            **facts: Further fields of the journal record.
        """
        folder = self.run.folder
        # Most runs have neither template nor tests: they are known from here on.
        self.run.mark = "" if lasting_secret() is None else "own"
        self.save()
        problem.write_files(folder)
        problem.write_originals(folder)
        if template.text is not None:
            write_atomic(folder / PROMPT_FILE, template.text)
        if given is not None:
            write_atomic(folder / GIVEN_FILE, given)
        self._take_files(folder / OWN_SUITE if problem.suite else None)
        self.save()
        # Written last: a run with a task but no mark is from another installation.
        write_atomic(folder / problem.file, problem.text)
        about = {"task": self.run.task, "learner": self.run.learner}
        self.event("run.start", **about, **facts)

    def resume(self, before: Run, **facts: Any) -> None:
        """Records that the run is resumed, and what is on record already.

        Args:
            before: The record of the last process; it stays in `run.json` for now.
            **facts: Further fields of the journal record.
        """
        past, self._before = self.past, before
        self._take_files(suite_in(self.run.folder))
        self.run.seconds, self.run.cost_lost = before.seconds, past.lost_usd
        self._write(self._with_earlier_progress(before))
        self.event(
            "run.resume",
            task=self.run.task,
            learner=self.run.learner,
            answers=Counter(str(one.get("kind")) for one in past.replies.values()),
            unanswered=past.unanswered,
            lost_usd=past.lost_usd,
            **facts,
        )

    def event(self, name: str, /, **facts: Any) -> bool:
        """Appends to the journal unless on record already; returns whether it did."""
        record = {"event": name, "seconds": round(self._elapsed(), 3), **facts}
        new = name not in REPEATED or not self.past.has_step(name, facts)
        if new:
            self._journal.append(record, marked=bool(self.run.mark))
        self.tell(record)
        return new

    def tell(self, record: dict[str, Any]) -> None:
        """Passes a record to `on_event` without writing it."""
        if self.on_event is not None:
            self.on_event(record)

    def numbered(self, request: Request) -> Request:
        """The request with `turn` and `repeat`, counted from earlier requests."""
        _, k, j = request.sample
        turn = self._turns[request.kind, k, j]
        repeat = self._asked[request.prompt]
        self._turns[request.kind, k, j] += 1
        self._asked[request.prompt] += 1
        return replace(request, turn=turn, repeat=repeat)

    def asked(self, request: Request, model: str, key: str, reserved: Amount) -> None:
        """Records a prompt before it is sent to a model."""
        self._write_question(request)
        self.event(
            "call.intent",
            **_about(request, key),
            model=model,
            prompt=self._blobs.put(request.prompt),
            max_tokens=request.max_tokens,
            reserved=asdict(reserved),
        )

    def missed(
        self, request: Request, key: str, miss: FailedCall, worst: Amount
    ) -> None:
        """Records a fault, and the wait before the next attempt, if any."""
        wait = None if miss.wait is None else round(miss.wait, 3)
        self.event(
            "call.fault",
            **_about(request, key),
            attempt=miss.attempt,
            fault=miss.fault.kind,
            reason=str(miss.fault),
            wait=wait,
            billed=miss.fault.billed,
        )
        if miss.fault.billed:
            self.run.cost_lost += worst.usd

    def answered(
        self,
        request: Request,
        reply: Reply,
        key: str,
        spent: Amount,
        cost: float | None,
    ) -> None:
        """Records an answer as it was received."""
        record = {
            **_about(request, key),
            **{k: v for k, v in asdict(reply).items() if k != "text"},
            "notes": list(reply.notes),
            "blob": self._blobs.put(reply.text),
            "spent": asdict(spent),
            "cost": cost,
        }
        self.event("call.reply", **record)
        self._count(request, reply, cost)

    def unused(self, request: Request, **facts: Any) -> None:
        """Records why an answer could not be used, and how often it was asked for."""
        _, k, j = request.sample
        self.event("call.unused", kind=request.kind, k=k, j=j, **facts)

    def recall(self, request: Request, key: str) -> Reply | None:
        """The answer on record to this question, if there is one."""
        record = self.past.replies.get(key, {})
        text = self._blobs.get(str(record.get("blob")))
        reply = None if text is None else reply_of(record, text)
        if reply is not None:
            self._write_question(request)
            self._count(request, reply, record.get("cost"))
            self.tell(record)
        return reply

    def _write_question(self, request: Request) -> None:
        write_if_changed(self._call_file(request, "prompt"), request.prompt)

    def _count(self, request: Request, reply: Reply, cost: float | None) -> None:
        write_if_changed(self._call_file(request, "reply"), reply.text)
        run = self.run
        run.tokens_in += reply.tokens_in
        run.tokens_out += reply.tokens_out
        run.tokens_cached += reply.tokens_cached
        run.cost = None if cost is None or run.cost is None else run.cost + cost
        if reply.model is not None and reply.model not in run.models:
            run.models = (*run.models, reply.model)

    def candidate(
        self, k: int, j: int, source: str, *, before: str | None = None
    ) -> Path:
        """Writes a candidate's source and its diff; returns the folder.

        Args:
            k: Its iteration.
            j: Its edit.
            source: Its source.
            before: Source to compare with; the previous candidate's by default.
        """
        folder, old = self._folder(k, j), self._previous if before is None else before
        write_if_changed(folder / "controller.py", source)
        write_if_changed(folder / "controller.diff", difference(old, source))
        self._previous = source
        return folder

    def deliver(self, source: str) -> None:
        """Writes the controller of the run, in place of an earlier one."""
        before, after = self._files.controllers[-1], sha256_of(source)
        if before != after and self.run.mark:
            # Killed in between, the folder has one of them.
            self._files = replace(self._files, controllers=(before, after))
            self.save()
        write_atomic(self.run.controller, source)
        self._files = replace(self._files, controllers=(after,))

    def vouch(self, file: Path) -> None:
        """Marks a report that this run has written, so that it can be reused."""
        if self.run.mark:
            self._journal.vouch(file)

    def vouches(self, file: Path) -> bool:
        """Whether a report may be reused: this run has written it, as it is now."""
        return bool(self.run.mark) and self._journal.vouches(file)

    def attempted(self, attempt: Attempt) -> bool:
        """Records the result of a candidate; returns whether it is new."""
        self.run.attempts.append(attempt)
        new = self.event("verify.end", **attempt.model_dump(mode="json"))
        if new:
            self.save()
        return new

    def rules(self, k: int, book: RuleBook, notes: tuple[str, ...] = ()) -> None:
        """Records the rules of the run, and how iteration k changed them."""
        rules = [rule.model_dump(mode="json") for rule in book.in_force]
        write_if_changed(
            self.run.folder / RULES_FILE, book.model_dump_json(indent=2) + "\n"
        )
        self.event("rules", k=k, rules=rules, notes=list(notes))

    def given_rules(self, text: str) -> None:
        """Keeps the rules that the run was given, as a rules file."""
        write_if_changed(self.run.folder / GIVEN_RULES_FILE, text)

    def finish(
        self, status: Status, enough: Enough | None = None, **facts: Any
    ) -> None:
        """Records the end of the run.

        Args:
            status: How it ended.
            enough: Limit to resume it with, if the budget ended it.
            **facts: Further fields of the journal record.
        """
        self.run.status, self.run.enough = status, enough
        self.run.reason = str(facts.get("reason", ""))
        self.run.outlook = str(facts.get("outlook", ""))
        self.run.censored = not (self.run.finished or self.run.passed)
        facts |= {} if enough is None else {"enough": str(enough)}
        self.event("run.end", status=status, **facts)
        self.save()

    def save(self) -> None:
        """Writes `run.json`; a resumed run that is not as far as before keeps it."""
        self.run.seconds = round(self._elapsed(), 3)
        before = self._before
        if (
            before is None
            or self.run.finished
            or len(self.run.attempts) >= len(before.attempts)
        ):
            self._write(self.run)
        else:
            self._write(self._with_earlier_progress(before))

    def _with_earlier_progress(self, before: Run) -> Run:
        """The run as an earlier process left it, with its present status and limits."""
        kept = ("max_cost", "max_tokens", "mark", "status", "seconds", "cost_lost")
        ended = ("reason", "enough", "outlook")
        present = {name: getattr(self.run, name) for name in (*kept, *ended)}
        run = before.model_copy(update=present)
        cut_short = run.status != "running" and not run.passed
        return run.model_copy(update={"censored": cut_short})

    def _take_files(self, suite: Path | None) -> None:
        """Hashes the files that the mark covers, once: later changes are not ours."""
        files = files_of(self.run.folder, suite)
        if files is None:
            self.run.mark = ""
        else:
            self._files = files

    def _write(self, run: Run) -> None:
        if self.run.mark:
            self.run.mark = run.mark = mark_of(run, self._files, self._journal)
        write_atomic(run.folder / RUN_FILE, run.model_dump_json(indent=2) + "\n")

    @property
    def _blobs(self) -> Blobs:
        return Blobs(self.run.folder / "blobs")

    def _call_file(self, request: Request, what: str) -> Path:
        _, k, j = request.sample
        return self._folder(k, j) / call_file(request.kind, what, request.turn + 1)

    def _folder(self, k: int, j: int) -> Path:
        folder = self.run.folder / candidate_at(k, j)
        folder.mkdir(parents=True, exist_ok=True)
        return folder

    def _elapsed(self) -> float:
        return self.past.seconds + time.monotonic() - self._clock


def _about(request: Request, key: str) -> dict[str, Any]:
    _, k, j = request.sample
    return {"kind": request.kind, "k": k, "j": j, "key": key}


def difference(before: str, after: str) -> str:
    """The unified diff of two sources; a note instead if they are too long."""
    old, new = before.splitlines(keepends=True), after.splitlines(keepends=True)
    if max(len(old), len(new)) > MOST_LINES:
        return f"(not compared: more than {MOST_LINES} lines)\n"
    return "".join(difflib.unified_diff(old, new, "previous", "controller.py"))
