"""The record of a run: its settings, progress and cost."""

from __future__ import annotations

import operator
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BeforeValidator, ConfigDict, Field, JsonValue

from tdac_agent.errors import RunError
from tdac_agent.models.budget import Enough
from tdac_agent.prompting.rules import RuleBook
from tdac_agent.storage.files import read_inside
from tdac_agent.storage.locks import LOCK_FILE, is_held
from tdac_agent.storage.printable_record import PrintableRecord, load_record
from tdac_agent.tasks.task_file import Profile
from tdac_envs.core.errors import nearest, one_line_reason
from tdac_envs.core.intake import RECORD_BYTES, parse_json

Status = Literal[
    "running",
    "verified",
    "passed",
    "not verified",
    "selected",
    "interrupted",
    "fault",
    "budget",
]
DELIVERED = ("verified", "passed", "selected")
"""Status of a run that has ended with a controller, as far as was asked for."""
FINISHED = (*DELIVERED, "not verified")
"""Status of a run with nothing left to do."""
LoopSetting = Literal[
    "dual tier",
    "edit only",
    "prompt only",
    "best of N",
    "one shot",
    "race",
    "first answers",
]
RACES: tuple[LoopSetting, ...] = ("race", "first answers")
"""Settings of `--search race`: with further questions, and without."""
Setting = LoopSetting | Literal["agent"]
Agent = Literal["", "unconfined", "over HTTP"]
AGENT = "mcp"
"""The learner of a run whose candidates an agent submits to `tdac mcp`."""
RUN_FILE = "run.json"
JOURNAL = "journal.jsonl"
RULES_FILE = "rules.json"
GIVEN_FILE = "given.py"
GIVEN_RULES_FILE = "given_rules.md"
PROMPT_FILE = "prompt.j2"


class Attempt(PrintableRecord):
    """The result of one candidate (k, j)."""

    model_config = ConfigDict(extra="forbid")

    k: int
    j: int
    valid: bool = Field(description="False if the model gave no code.")
    passed: bool
    failed_tests: tuple[str, ...] = ()
    seed: int | None = Field(None, description="Seed of its jittered starts.")
    confirmed: bool | None = Field(
        None, description="Result of its blind confirmation; None without one."
    )
    notes: tuple[str, ...] = ()
    unchanged: bool = Field(
        False, description="Same code as an earlier candidate, whose report is reused."
    )
    parent: tuple[int, int] | None = Field(
        None, description="(k, j) of the candidate that it was to improve, in a race."
    )
    merged: tuple[int, int] | None = Field(
        None,
        exclude_if=lambda value: value is None,
        description="(k, j) of the candidate that it was to be merged with.",
    )
    asked: str = Field(
        "", exclude_if=operator.not_, description="Kind of the question, in a race."
    )

    @property
    def parents(self) -> tuple[tuple[int, int], ...]:
        """(k, j) of the candidates that its question was about, in a race."""
        return tuple(each for each in (self.parent, self.merged) if each is not None)


class Confirmation(PrintableRecord):
    """The blind confirmation of a candidate that passed all tests."""

    model_config = ConfigDict(extra="forbid")

    k: int
    j: int
    episodes: int = Field(description="Drives, up to the decision.")
    failures: int
    passed: bool


class Run(PrintableRecord):
    """`run.json`: the record of one synthesis."""

    model_config = ConfigDict(extra="forbid")

    schema_version: Literal[1] = 1
    folder: Path = Field(exclude=True)
    task: str
    task_sha256: str
    dynamics: str = Field(
        "", description="Hash of the task with its code; empty before Ladder 1.0."
    )
    learner: str
    optimizer: str
    iterations: int = Field(description="K")
    patience: int = Field(description="J")
    search: str = Field(
        "",
        exclude_if=operator.not_,
        description="`paper` or `race`; empty in records of earlier versions: paper.",
    )
    ask: str = Field(
        "", exclude_if=operator.not_, description="Kinds of questions of a race."
    )
    candidates: int = Field(
        1, description="N: new controllers that are asked for side by side."
    )
    seed: int | None = Field(
        description="Seed of the jittered starts; None: each candidate has its own."
    )
    status: Status = "running"
    tau: int | None = Field(None, description="Iteration k of the first success.")
    attempts: list[Attempt] = Field(default_factory=list)
    tokens_in: int = 0
    tokens_out: int = 0
    tokens_cached: int = Field(0, description="Part of tokens_in, read from a cache.")
    models: tuple[str, ...] = Field((), description="As reported by the providers.")
    base_url: str | None = Field(None, description="As given.")
    served_at: dict[str, str] = Field(
        {}, description="Server address by model, unless it is the vendor's."
    )
    profile: Profile = Field("paper", description="What a controller must define.")
    prompt: str = Field("full", description="Template of the first question.")
    refine: bool = Field(True, description="Whether failures become rules.")
    vision: bool = Field(
        False,
        exclude_if=operator.not_,
        description="Whether pictures went with questions, as an option of earlier "
        "versions said.",
    )
    max_output: int = Field(0, description="Token limit of an answer.")
    index: int = Field(0, description="Index among otherwise equal runs.")
    version: str = Field("", description="Version of tdac.")
    suite_sha256: str = ""
    given_rules: tuple[str, ...] = Field(
        (), description="Rules that the run began with, each with its scope."
    )
    omit: str = Field(
        "",
        exclude_if=operator.not_,
        description="Facts that the first question withholds, separated by commas.",
    )
    prompt_sha256: str = Field("", description="Hash of the first question.")
    given_sha256: str | None = Field(
        None, description="Hash of the controller to start from."
    )
    max_cost: float | None = Field(None, ge=0, description="Limit, USD.")
    max_tokens: int | None = Field(None, ge=0)
    cost: float | None = Field(None, description="USD of all answers; None if unknown.")
    cost_lost: float = Field(
        0.0, description="Upper bound for lost answers, USD, in addition to `cost`."
    )
    mark: str = Field(
        "", description="MAC by which an installation recognises its own runs."
    )
    episodes: int | None = Field(
        None,
        description="Simulated episodes that the candidates of a run on a task set may "
        "use; None for a run on one task.",
    )
    feedback_episodes: int | None = Field(
        None, description="Most episodes of a test of a candidate on a task set."
    )
    improve: int = Field(
        0, description="Further simulated episodes, to improve what works."
    )
    envelope: int = Field(
        0,
        exclude_if=operator.not_,
        description="Most episodes of each search for a smallest failure.",
    )
    then_verify: bool = Field(
        False, description="Whether the selected controller drives on hidden worlds."
    )
    confirm: bool = Field(
        False,
        description="Whether a controller of a task that passed all tests drives blind "
        "before it is verified; False in records of earlier versions.",
    )
    confirmations: list[Confirmation] = Field(
        default_factory=list, description="Of a task, in the order of their numbers."
    )
    options: dict[str, JsonValue] = Field(
        {}, description="Options of the synthesis that have no field of their own."
    )
    agent: Agent = Field(
        "",
        description="How the agent that submits candidates is connected, if one does: "
        "`unconfined` if it ran, at least once, as the same user.",
    )
    clients: tuple[str, ...] = Field(
        (), description="Name and version of its programs, as they reported them."
    )
    id: str = ""
    started: str
    seconds: float = 0.0
    reason: str = Field("", description="Why it ended, if by a fault or the budget.")
    enough: Annotated[Enough | None, BeforeValidator(lambda value: value or None)] = (
        Field(None, description="Limit to resume with, if the budget ended it.")
    )
    outlook: str = Field("", description="Limits that suffice, if the budget ended it.")
    censored: bool = Field(False, description="Ended before success or K.")

    @property
    def of_loop(self) -> list[Attempt]:
        """The attempts of the loop: those that are no variations of what works."""
        return [each for each in self.attempts if each.k <= self.iterations]

    @property
    def verified(self) -> bool:
        """Whether its controller drove blind, with few enough failures.

        Runs on a task of earlier versions have no such drives: they only passed.
        """
        return self.status == "verified" and (self.on_set or self.confirm)

    @property
    def passed(self) -> bool:
        """Whether a controller of a task passed all tests, though the run may go on."""
        return self.tau is not None and not self.on_set

    @property
    def finished(self) -> bool:
        """Whether there is nothing left to do."""
        return self.status in FINISHED

    @property
    def on_set(self) -> bool:
        """Whether the controller is for a task set, not for one task."""
        return self.episodes is not None

    @property
    def setting(self) -> Setting:
        """Which parts of the loop were used."""
        if self.learner == AGENT:
            return "agent"
        if self.search == "race":
            return RACES[self.candidates >= self.iterations]
        return setting_of(self.iterations, self.patience, refine=self.refine)

    @property
    def tokens(self) -> int:
        """Input and output tokens together."""
        return self.tokens_in + self.tokens_out

    @property
    def controller(self) -> Path:
        """Path of the controller that was verified, passed or was selected."""
        return self.folder / "controller.py"


def setting_of(iterations: int, patience: int, *, refine: bool) -> Setting:
    """The setting that results from K, J and the refinement of the prompt.

    With both kinds of repair it is the paper's dual tier. With neither, a run draws new
    candidates until one passes.
    """
    if refine and iterations > 1:
        return "dual tier" if patience else "prompt only"
    if patience:
        return "edit only"
    return "one shot" if iterations == 1 else "best of N"


def candidate_at(k: int, j: int) -> Path:
    """The folder of a candidate, relative to that of its run."""
    return Path("iterations", f"k{k:02d}", f"j{j}")


def call_file(kind: str, what: str, number: int) -> str:
    """Name such as `edit.reply.md`; `edit.reply-2.md` for the second question."""
    return f"{kind}.{what}{f'-{number}' if number > 1 else ''}.md"


def at_work(folder: Path) -> bool:
    """Whether a process is at work on a run."""
    return is_held(folder / LOCK_FILE)


def status_now(run: Run, *, before: bool) -> str:
    """Its present status; `killed` if the process that wrote `running` is gone.

    A run with a controller that passed all tests is `passed`, though it has ended early
    and may go on to improve it.

    Args:
        run: The run.
        before: Whether a process was at work before the record was read; otherwise a
            run that ended in between would seem to be killed.
    """
    if run.finished:
        return run.status if run.verified or run.status != "verified" else "passed"
    if before or at_work(run.folder):
        return "running"
    if run.passed:
        return "passed"
    return "killed" if run.status == "running" else run.status


def load_run(folder: Path) -> Run:
    """Reads a run folder.

    Raises:
        RunError: The folder has no readable `run.json`.
    """
    try:
        content = parse_json(read_inside(folder, RUN_FILE, RECORD_BYTES))
        return Run.model_validate({**content, "folder": folder})
    except FileNotFoundError as error:
        raise RunError(f"{folder} is not a run folder: {_missing(folder)}") from error
    except (OSError, ValueError, TypeError) as error:
        raise RunError(
            f"{folder} is not a run folder: {RUN_FILE}: {one_line_reason(error)}"
        ) from error


def _missing(folder: Path) -> str:
    """Why there is no `run.json`; suggests the run folder with the nearest name."""
    if folder.is_dir():
        return f"it has no {RUN_FILE}"
    beside = [path.parent.name for path in folder.parent.glob(f"*/{RUN_FILE}")]
    meant = nearest(folder.name, beside)
    return "there is no such folder" + (
        f" (did you mean {folder.parent / meant}?)" if meant else ""
    )


def load_rules(folder: Path) -> RuleBook:
    """The rules of a run folder; none before the end of the first iteration.

    Raises:
        RunError: The file is damaged.
    """
    path = folder / RULES_FILE
    try:
        return load_record(RuleBook, folder, RULES_FILE)
    except FileNotFoundError:
        return RuleBook()
    except (OSError, ValueError) as error:
        raise RunError(
            f"{path} is not a rules file: {one_line_reason(error, RuleBook)}"
        ) from error
