"""Prepares a run before its first question: its record, budget and folder."""

from __future__ import annotations

import importlib.metadata
import secrets
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from tdac_agent.errors import RunError
from tdac_agent.models.budget import Budget
from tdac_agent.models.provider import Author, Provider, recorded_seed, served_at
from tdac_agent.models.ready import check_servers
from tdac_agent.models.tariff import Tariff, bounds_of, tariffs_of
from tdac_agent.problems.problem import Problem
from tdac_agent.prompting.prompt import FULL, PromptTemplate
from tdac_agent.runs.journal_state import read_past
from tdac_agent.runs.ownership import remark_on
from tdac_agent.runs.recorder import Event, Recorder
from tdac_agent.runs.run_record import JOURNAL, Run
from tdac_agent.storage.files import clear_unfinished
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.storage.journal import read_records, repair_end
from tdac_agent.storage.locks import own_folder
from tdac_agent.tasks.installation import drawn_seed, lasting_secret


@dataclass(frozen=True, slots=True)
class Account:
    """What a run may spend, and what its models cost.

    Attributes:
        budget: Budget of this run, or shared by several.
        tariffs: Tariffs by model name.
        notes: Notes for the user.
    """

    budget: Budget
    tariffs: Mapping[str, Tariff]
    notes: tuple[str, ...] = ()


def account_of(
    models: Sequence[Provider],
    before: Run | None,
    max_cost: float | None,
    max_tokens: int | None,
    shared: Budget | None,
) -> Account:
    """The account of a run; limits that are not given are those of `before`.

    Raises:
        ProviderError: Nothing bounds what a model costs, or a key or package is
            missing; the message lists everything.
        PriceError: The user's price file is broken.
        Fault: A server that a new run needs does not answer.
    """
    tariffs = tariffs_of(models)
    if shared is not None:
        if max_cost is not None or max_tokens is not None:
            raise ValueError("give either a shared budget, or max_cost and max_tokens")
        bounds = bounds_of(models, tariffs, shared.max_cost, shared.max_tokens)
        return Account(shared, tariffs, bounds.notes)
    if before is not None:
        max_cost = before.max_cost if max_cost is None else max_cost
        max_tokens = before.max_tokens if max_tokens is None else max_tokens
    bounds = bounds_of(models, tariffs, max_cost, max_tokens)
    if before is None:
        check_servers(models)
    return Account(Budget(bounds.max_cost, bounds.max_tokens), tariffs, bounds.notes)


def new_run(
    problem: Problem,
    models: Sequence[Author],
    template: PromptTemplate,
    start_from: str | None = None,
    **facts: Any,
) -> Run:
    """The record of a run that has not begun.

    Args:
        problem: What the controller is for.
        models: Learner and optimizer.
        template: Template of the first question.
        start_from: Source of an initial controller, if there is one.
        **facts: Further fields of `Run`.

    Raises:
        PromptError: The template cannot be used.
    """
    addresses = {model.name: served_at(model) for model in models}
    return Run(
        task=problem.name,
        task_sha256=problem.sha256,
        dynamics=problem.dynamics,
        profile=problem.profile,
        suite_sha256=problem.suite_sha256,
        learner=models[0].name,
        optimizer=models[1].name,
        served_at={name: url for name, url in addresses.items() if url is not None},
        version=importlib.metadata.version("tdac"),
        prompt=template.name,
        prompt_sha256=sha256_of(problem.question((), template)),
        given_sha256=None if start_from is None else sha256_of(start_from),
        cost=0.0,
        id=secrets.token_hex(8),
        started=datetime.now(UTC).isoformat(timespec="seconds"),
        **facts,
    )


def settled_seed(
    given: int | None, learner: Provider, before: Run | None, *, needed: bool
) -> int | None:
    """The seed of a run; None if each of its candidates has its own.

    If a seed is needed, or no secret can be kept, one is drawn for a new run.

    Args:
        given: The seed that the user gives.
        learner: The learner, which may have a recorded one.
        before: The record of an earlier process, if there was one.
        needed: Whether a seed is needed.
    """
    known = recorded_seed(learner) if given is None else given
    if known is not None or (not needed and lasting_secret() is not None):
        return known
    return drawn_seed() if before is None else before.seed


def hold_folder(out: Path) -> AbstractContextManager[None]:
    """Makes a run folder, and locks it against other processes in a `with` block.

    Raises:
        RunError: The folder cannot be made, another process is at work in it, or a link
            leads out of it.
    """
    return own_folder(out, "*")


def open_record(
    problem: Problem,
    run: Run,
    before: Run | None,
    account: Account,
    template: PromptTemplate = FULL,
    given: str | None = None,
    on_event: Event | None = None,
) -> Recorder:
    """The recorder of a new or resumed run; recorded calls count in the budget.

    Args:
        problem: What the controller is for.
        run: The record.
        before: The record of an earlier process, if there was one.
        account: What the run may spend.
        template: Template of the first question.
        given: Source of an initial controller, if there is one.
        on_event: Called with each journal record.

    Raises:
        RunError: The folder cannot be written.
    """
    budget = account.budget
    run.max_cost, run.max_tokens = budget.max_cost, budget.max_tokens
    remark = "" if before is None else remark_on(before)
    facts = {
        "max_cost": budget.max_cost,
        "max_tokens": budget.max_tokens,
        "notes": [*account.notes, *filter(None, [remark])],
    }
    if before is not None:
        run.id, run.started, run.prompt = before.id, before.started, before.prompt
        # Another installation's run gets no mark, even if it is trusted this time.
        run.mark = "" if remark else before.mark
    try:
        repair_end(run.folder / JOURNAL)
        past = read_past(read_records(run.folder / JOURNAL))
        budget.restore({f"{run.id}/{call}": a for call, a in past.taken.items()})
        recorder = Recorder(run, past, on_event)
        if before is not None and past.started:
            clear_unfinished(run.folder)
            recorder.resume(before, **facts)
        else:
            recorder.begin(problem, template, given, **facts)
    except OSError as error:
        raise RunError(f"cannot write to {run.folder}: {error.strerror}") from error
    return recorder
