"""Writes a controller for a task set: tests, repairs, selection, budget of episodes."""

from __future__ import annotations

from contextlib import ExitStack, suppress
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from tdac_agent.metrics.paired import paired_change
from tdac_agent.models.budget import Budget
from tdac_agent.models.choice import choose_models
from tdac_agent.models.provider import MAX_OUTPUT_TOKENS, Provider, recorded_seed
from tdac_agent.models.retry import RetryPolicy
from tdac_agent.prompting.given_rules import given_lines
from tdac_agent.prompting.prompt import load_template
from tdac_agent.prompting.rules import RuleBook
from tdac_agent.prompting.set_prompt import check_generated, set_prompt
from tdac_agent.runs.recorder import Event
from tdac_agent.runs.resume import check_own, check_same, existing_run
from tdac_agent.runs.run_record import Run
from tdac_agent.runs.selection_record import Improvement
from tdac_agent.set_synthesis.delivery import deliver_selected, start_on_set
from tdac_agent.set_synthesis.hidden import verify_hidden
from tdac_agent.set_synthesis.improve import (
    SetExplorer,
    base_of,
    finalists,
    founders,
)
from tdac_agent.set_synthesis.search import search
from tdac_agent.set_synthesis.selection import select
from tdac_agent.set_synthesis.trials import MOST_EPISODES, Candidate, Trials
from tdac_agent.synthesis.archive import Archive
from tdac_agent.synthesis.calls import Calls, OutOfBudget
from tdac_agent.synthesis.dialogue import Dialogue
from tdac_agent.synthesis.improve import ImprovingSearch
from tdac_agent.synthesis.setup import (
    account_of,
    checked_vision,
    hold_folder,
    new_run,
    open_record,
)
from tdac_agent.synthesis.workload import LEAST_IMPROVE, shares
from tdac_agent.tasks.installation import drawn_seed
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_envs.core.arguments import whole_number
from tdac_envs.ladder.task_sets import TaskSet

EPISODES = 128
"""Default limit of simulated episodes: half for tests, half for the selection."""
FEEDBACK_EPISODES = 8
ABOUT = "this task set"


def synthesize_on_set(
    tasks: TaskSet,
    learner: str | Provider = "builtin",
    optimizer: str | Provider | None = None,
    *,
    out: Path,
    episodes: int = EPISODES,
    feedback_episodes: int = FEEDBACK_EPISODES,
    improve: int = 0,
    then_verify: bool = False,
    iterations: int = 20,
    patience: int = 1,
    candidates: int = 1,
    seed: int | None = None,
    start_from: str | None = None,
    base_url: str | None = None,
    key_over_http: bool = False,
    prompt: str = "full",
    refine: bool = True,
    rules: RuleBook | None = None,
    vision: bool = False,
    max_output: int = MAX_OUTPUT_TOKENS,
    max_cost: float | None = None,
    max_tokens: int | None = None,
    budget: Budget | None = None,
    index: int = 0,
    retry: RetryPolicy | None = None,
    tier: str = "auto",
    judge: WarmJudge | None = None,
    on_event: Event | None = None,
) -> Run:
    """Writes, tests and repairs controllers for a set, and selects the best one.

    Args:
        tasks: The task set.
        learner: As for `synthesize`, like all arguments that are not listed here.
        optimizer: See there.
        out: New or empty folder for the run, or one with the same run.
        episodes: Maximum number of simulated episodes of all candidates together: half
            for tests, half for the selection.
        feedback_episodes: Maximum number of episodes in each test of a candidate.
        improve: Further simulated episodes, for variations of the candidates that work
            (`tdac_agent.synthesis.workload.shares`); 0 for none.
        then_verify: Whether the selected controller drives on hidden worlds at the end,
            for a verdict; also of a run that has selected one before.
        iterations: K, the maximum number of iterations.
        patience: J, edits per iteration.
        candidates: N, new controllers that are asked for side by side, each of them an
            iteration. They drive on the same worlds, and the best one is repaired.
        seed: Determines the worlds of `dev`; drawn by default.
        start_from: Source of an initial controller instead of a generated one.
        base_url: See `synthesize`.
        key_over_http: See there.
        prompt: `full`, or a template file.
        refine: See there.
        rules: See there.
        vision: See there; the pictures show worlds of `dev`.
        max_output: See there.
        max_cost: See there.
        max_tokens: See there.
        budget: See there.
        index: See there.
        retry: See there.
        tier: See there.
        judge: See there.
        on_event: Called with each journal record.

    Returns:
        The run: `selected`, `not verified`, or `verified` on hidden worlds. Its
        `controller` is the selected one.

    Raises:
        TaskError: A number is out of range, or the set's worlds are in files.
        RunError: The folder cannot be used, or contains another run.
        ProviderError: A model cannot be used, or pictures would have no effect.
        PriceError: The user's price file is broken.
        PromptError: The template cannot be used.
        Fault: The sandbox or provider is broken; the fault is also recorded.
    """
    episodes = whole_number("episodes", episodes, 2, MOST_EPISODES)
    block = whole_number("feedback_episodes", feedback_episodes, 1, MOST_EPISODES)
    if improve:
        whole_number("improve", improve, LEAST_IMPROVE, MOST_EPISODES)
    check_generated(tasks)
    template, book = load_template(prompt), rules or RuleBook()
    models = choose_models(
        learner, optimizer, tasks, base_url, key_over_http=key_over_http
    )
    question = partial(set_prompt, tasks, template=template)
    before = existing_run(out)
    run = new_run(
        models,
        question(()),
        start_from,
        task=tasks.name,
        task_sha256=tasks.sha256,
        profile="policy",
        prompt=template.name,
        folder=out,
        base_url=base_url,
        max_output=max_output,
        index=index,
        iterations=iterations,
        patience=patience,
        candidates=whole_number("candidates", candidates, 1),
        refine=refine,
        vision=checked_vision(vision, models[1].name, patience, improve),
        given_rules=given_lines(book),
        seed=_seed(seed, models[0], before),
        episodes=episodes,
        feedback_episodes=block,
        improve=improve,
        then_verify=then_verify or (before is not None and before.then_verify),
    )
    account = account_of(models, before, max_cost, max_tokens, budget)
    with hold_folder(out):
        before = existing_run(out)
        if before is not None:
            check_same(before, run)
            if before.finished and not (
                run.then_verify and before.status == "selected"
            ):
                check_own(before)
                return before
        start = start_on_set(tasks, template, start_from)
        recorder = open_record(start, run, before, account, on_event)
        terms = (account.budget, account.tariffs, retry or RetryPolicy(), max_output)
        calls = Calls(recorder, *terms)
        dialogue = Dialogue(question, *models, calls, book, about=ABOUT)
        dialogue.begin()
        with ExitStack() as stack:
            warm = judge or stack.enter_context(WarmJudge())
            parts = shares(episodes, improve)
            trials = Trials(tasks, recorder, warm, tier, block, parts)
            return _run(_Writing(dialogue, trials, start_from))


def _seed(given: int | None, learner: Provider, before: Run | None) -> int:
    """The seed of a run: given, recorded, or drawn."""
    known = recorded_seed(learner) if given is None else given
    if known is None and before is not None:
        known = before.seed
    return drawn_seed() if known is None else known


@dataclass(frozen=True, slots=True)
class _Writing:
    """A run at work.

    Attributes:
        dialogue: The models.
        trials: Tests candidates.
        given: Source of an initial controller, if there is one.
    """

    dialogue: Dialogue
    trials: Trials
    given: str | None


def _run(writing: _Writing) -> Run:
    """Writes, selects and delivers, and records how it ended."""
    recorder = writing.trials.recorder
    try:
        _finish(writing)
    except OutOfBudget as error:
        recorder.finish(
            "budget", error.way_on, reason=str(error), outlook=error.outlook
        )
    except KeyboardInterrupt:
        recorder.finish("interrupted")
        raise
    except Exception as error:
        # On a full disk, the first error is the one to report.
        with suppress(OSError):
            recorder.finish("fault", reason=str(error))
        raise
    return recorder.run


def _finish(writing: _Writing) -> None:
    trials, recorder = writing.trials, writing.trials.recorder
    written: list[Candidate] = []
    try:
        stopped = search(writing.dialogue, writing.given, trials, written)
    except OutOfBudget as error:
        # With more money, the run can go on; what is good for something is selected.
        if not any(each.feedback_score for each in written):
            raise
        stopped = str(error)
    able = [each for each in written if each.drives]
    archive = None
    if recorder.run.improve and any(each.feedback_score for each in able):
        archive, ended = _improved(writing, written)
        stopped = ended or stopped
        able = finalists(archive)
    chosen = None
    if able:
        chosen = select(able, trials.validation_left, trials.validate)
    if chosen is None or not chosen.score:
        recorder.finish("not verified", reason=_why_none(able))
        return
    improvement = None if archive is None else _compared(trials, archive, chosen)
    deliver_selected(trials, written, chosen, stopped, improvement)
    recorder.run.tau = chosen.k
    status, facts = "selected", {"k": chosen.k, "j": chosen.j, "reason": stopped}
    if recorder.run.then_verify:
        report = verify_hidden(
            trials.tasks, recorder, chosen.source, trials.judge, trials.tier
        )
        status = "verified" if report.passed else "not verified"
    recorder.finish(status, **facts)  # type: ignore[arg-type]


def _improved(
    writing: _Writing, written: list[Candidate]
) -> tuple[Archive[Candidate], str]:
    """Searches for improvements; also returns what ended this early, if anything did.

    Without money for further questions, the run goes on with what there is.
    """
    trials = writing.trials
    begun = founders(trials, written)
    search = ImprovingSearch(writing.dialogue, SetExplorer(trials), written)
    try:
        search.run(begun)
    except OutOfBudget as error:
        return search.archive, str(error)
    return search.archive, ""


def _compared(
    trials: Trials, archive: Archive[Candidate], chosen: Candidate
) -> Improvement:
    """Compares the selected candidate with what the search began with."""
    base = base_of(archive)
    about = {"variations": archive.variations, "k": base.k, "j": base.j}
    if chosen is base:
        return Improvement(worlds=0, **about)
    before, after = (
        [each.time_score for each in trials.compare(one).episodes]
        for one in (base, chosen)
    )
    change = asdict(paired_change(before, after))
    return Improvement(worlds=len(before), **change, **about)


def _why_none(able: list[Candidate]) -> str:
    if not able:
        return "no candidate passed the static and contract tests"
    return "no candidate reached a goal on the validation worlds"
