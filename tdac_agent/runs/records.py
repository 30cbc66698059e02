"""A run on disk: what it was asked for, how far it came, and what it took."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import ConfigDict, Field

from tdac_agent.errors import RunError
from tdac_agent.prompting.rules import RuleBook
from tdac_agent.storage.locks import LOCK_FILE, is_held
from tdac_agent.storage.printable_record import PrintableRecord
from tdac_envs.core.errors import nearest, why
from tdac_envs.core.intake import RECORD_BYTES, parse_json, read_file

Status = Literal[
    "running", "verified", "not verified", "interrupted", "fault", "budget"
]
Setting = Literal["dual tier", "edit only", "prompt only", "best of N", "one shot"]
RUN_FILE = "run.json"
JOURNAL = "journal.jsonl"
RULES_FILE = "rules.json"
GIVEN_FILE = "given.py"
PROMPT_FILE = "prompt.j2"


class Attempt(PrintableRecord):
    """One candidate (k, j)."""

    model_config = ConfigDict(extra="forbid")

    k: int
    j: int
    valid: bool = Field(description="False where the model gave no code.")
    passed: bool
    failed_tests: tuple[str, ...] = ()
    seed: int | None = Field(None, description="Of its moved starts.")
    notes: tuple[str, ...] = ()
    unchanged: bool = Field(
        False, description="The code of the attempt before, whose report stands."
    )


class Run(PrintableRecord):
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
    seed: int | None = Field(
        description="Of the moved starts of all candidates; None: each has its own."
    )
    status: Status = "running"
    tau: int | None = Field(None, description="Iteration k of the first success.")
    attempts: list[Attempt] = Field(default_factory=list)
    tokens_in: int = 0
    tokens_out: int = 0
    tokens_cached: int = Field(0, description="Of tokens_in, read from a cache.")
    models: tuple[str, ...] = Field((), description="As the providers report them.")
    base_url: str | None = Field(None, description="As given.")
    served_at: dict[str, str] = Field(
        {}, description="Address of each model's server that is not the vendor's."
    )
    prompt: str = Field("full", description="Template of the first question.")
    refine: bool = Field(True, description="Whether failures become rules.")
    max_output: int = Field(0, description="Tokens that an answer may have.")
    index: int = Field(0, description="Of several runs of the same.")
    version: str = Field("", description="Of this program.")
    suite_sha256: str = ""
    prompt_sha256: str = Field("", description="Of the first question.")
    given_sha256: str | None = Field(
        None, description="Of the controller to begin with."
    )
    max_cost: float | None = Field(None, description="USD.")
    max_tokens: int | None = None
    cost: float | None = Field(None, description="USD of all answers; None if unknown.")
    cost_lost: float = Field(
        0.0, description="USD at most of calls whose answer was lost, on top."
    )
    mark: str = Field(
        "", description="By which the installation that began it knows it again."
    )
    id: str = ""
    started: str
    seconds: float = 0.0
    reason: str = Field("", description="Why it ended, of a fault or the budget.")
    enough: str = Field("", description="Flag with which it can go on, of the budget.")
    outlook: str = Field("", description="How much is enough for what, of the budget.")
    censored: bool = Field(False, description="Ended before success or K.")

    @property
    def verified(self) -> bool:
        """Whether a controller passed."""
        return self.status == "verified"

    @property
    def finished(self) -> bool:
        """Whether there is nothing left to do."""
        return self.status in {"verified", "not verified"}

    @property
    def setting(self) -> Setting:
        """What of the loop was in use."""
        return setting_of(self.iterations, self.patience, refine=self.refine)

    @property
    def tokens(self) -> int:
        """In and out together."""
        return self.tokens_in + self.tokens_out

    @property
    def controller(self) -> Path:
        """Path of the verified controller."""
        return self.folder / "controller.py"


def setting_of(iterations: int, patience: int, *, refine: bool) -> Setting:
    """The loop that K, J and the prompt's refinement make.

    Both repairs are the paper's dual tier; with neither, a run draws one candidate
    after the other until one passes.
    """
    if refine and iterations > 1:
        return "dual tier" if patience else "prompt only"
    if patience:
        return "edit only"
    return "one shot" if iterations == 1 else "best of N"


def at_work(folder: Path) -> bool:
    """Whether a process is at work on a run."""
    return is_held(folder / LOCK_FILE)


def status_now(run: Run, *, before: bool) -> str:
    """Its status; `killed` where the process that wrote `running` is gone.

    Args:
        run: The run.
        before: Whether it was at work before its record was read. Without that, one
            that ends in between would seem to have been killed.
    """
    if run.finished:
        return run.status
    if before or at_work(run.folder):
        return "running"
    return "killed" if run.status == "running" else run.status


def load_run(folder: Path) -> Run:
    """Reads a run folder.

    Raises:
        RunError: It holds no readable `run.json`.
    """
    path = folder / RUN_FILE
    try:
        content = parse_json(read_file(path, RECORD_BYTES))
        return Run.model_validate({**content, "folder": folder})
    except FileNotFoundError as error:
        raise RunError(f"{folder} is not a run folder: {_missing(folder)}") from error
    except (OSError, ValueError, TypeError) as error:
        raise RunError(
            f"{folder} is not a run folder: {RUN_FILE}: {why(error)}"
        ) from error


def _missing(folder: Path) -> str:
    """Why there is no `run.json`, and which run beside it may be meant."""
    if folder.is_dir():
        return f"it has no {RUN_FILE}"
    beside = [path.parent.name for path in folder.parent.glob(f"*/{RUN_FILE}")]
    meant = nearest(folder.name, beside)
    return "there is no such folder" + (
        f" (did you mean {folder.parent / meant}?)" if meant else ""
    )


def load_rules(folder: Path) -> RuleBook:
    """The rules of a run folder; none where no iteration came to an end.

    Raises:
        RunError: Their file is damaged.
    """
    path = folder / RULES_FILE
    try:
        return RuleBook.model_validate(parse_json(read_file(path, RECORD_BYTES)))
    except FileNotFoundError:
        return RuleBook()
    except (OSError, ValueError) as error:
        raise RunError(f"{path} holds no rules: {why(error)}") from error
