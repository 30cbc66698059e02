"""Algorithm 2: test-driven synthesis of a controller."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from tdac_agent.errors import ControllerFileError
from tdac_agent.models.budget import Budget
from tdac_agent.models.choice import choose_models
from tdac_agent.models.provider import Provider
from tdac_agent.models.retry import RetryPolicy
from tdac_agent.problems.choice import problem_of
from tdac_agent.problems.problem import Problem
from tdac_agent.prompting.given_rules import given_lines, read_given
from tdac_agent.prompting.prompt import load_template
from tdac_agent.prompting.rules import RuleBook
from tdac_agent.runs.recorder import Event
from tdac_agent.runs.resume import check_own, check_same, existing_run
from tdac_agent.runs.run_record import Run
from tdac_agent.synthesis.archive import Archive
from tdac_agent.synthesis.calls import Calls, OutOfBudget
from tdac_agent.synthesis.candidates import Candidate
from tdac_agent.synthesis.dialogue import Dialogue
from tdac_agent.synthesis.iterations import Iterations
from tdac_agent.synthesis.options import RACE, SynthOptions
from tdac_agent.synthesis.question_kinds import RULES
from tdac_agent.synthesis.race import MOST_STALE, Race
from tdac_agent.synthesis.selection import select
from tdac_agent.synthesis.settled import kinds_of, settled
from tdac_agent.synthesis.setup import (
    account_of,
    hold_folder,
    new_run,
    open_record,
    settled_seed,
)
from tdac_agent.synthesis.terms import Chosen, Terms
from tdac_agent.synthesis.trials import Trials, conclude, trials_of
from tdac_agent.synthesis.workload import LEAST_IMPROVE, MOST_EPISODES, shares
from tdac_agent.tasks.task import Task
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.verify import check_physics, read_source
from tdac_envs.core.arguments import whole_number
from tdac_envs.core.errors import TaskError

if TYPE_CHECKING:
    from tdac_envs.ladder.task_sets import TaskSet


def synthesize(
    problem: Task | TaskSet | Problem,
    learner: str | Provider | None = None,
    optimizer: str | Provider | None = None,
    *,
    out: Path,
    options: SynthOptions | None = None,
    budget: Budget | None = None,
    index: int = 0,
    retry: RetryPolicy | None = None,
    judge: WarmJudge | None = None,
    on_event: Event | None = None,
    **keywords: Any,
) -> Run:
    """Writes, tests and repairs controllers, and delivers the best one.

    On a task, a controller that passes its suite drives blind (`confirm`); the first
    one that is confirmed is delivered, or with `improve` the best variation of it. On a
    task set, controllers drive on worlds of `dev`, and the best one is selected on
    further worlds.

    If `out` contains the same run, unfinished, that run is resumed: recorded answers
    and results are reused (docs/models.md).

    Args:
        problem: What the controller is for: a task, or a task set.
        learner: LLM1 of the paper, which writes controllers: a provider, or its name
            such as `anthropic:MODEL` (docs/models.md); by default the one of `options`.
        optimizer: LLM2, which edits code and writes rules; the learner by default.
        out: New or empty folder for the run, or one with the same run.
        options: Options; the defaults are those of `tdac synth`.
        budget: Budget shared with other runs, instead of `max_cost` and `max_tokens`.
        index: Index among otherwise equal runs, which keeps their answers apart.
        retry: Retry policy after faults.
        judge: A warm judge, to reuse in consecutive runs; None starts one.
        on_event: Called with each journal record.
        **keywords: Fields of `SynthOptions`, instead of the same fields of `options`.

    Returns:
        The run: `verified`, `passed` (on a task without `confirm`), `selected` (on a
        task set without `then_verify`), `not verified`, or `budget`. If it has a
        controller, that is `run.controller`.

    Raises:
        TypeError: There is no option of this name.
        TaskError: A number is out of range, or the problem cannot be used.
        RunError: The folder cannot be used, or contains another run.
        ProviderError: A model cannot be used, e.g. without its key, or nothing bounds
            what it costs.
        PriceError: The user's price file is broken.
        PromptError: The template cannot be used.
        Fault: The sandbox, suite or provider is broken; the fault is also recorded.
    """
    named = {"learner": learner, "optimizer": optimizer}
    given = {name: value for name, value in named.items() if value is not None}
    wanted = (options or SynthOptions()).changed(**keywords, **given)
    about = problem_of(problem)
    wanted = settled(wanted, on_set=about.has_hidden)
    if wanted.suite is not None:
        about = about.permitted(wanted.suite)
    _check(wanted, about)
    models = _models(wanted, about)
    template, book = load_template(wanted.prompt), book_of(wanted.rules)
    source, before = _source(wanted.start_from), existing_run(out)
    run = new_run(
        about,
        models,
        template,
        source,
        folder=out,
        index=index,
        given_rules=given_lines(book),
        **_recorded(wanted, about, models, before),
    )
    limits = wanted.max_cost, wanted.max_tokens
    account = account_of(models, before, *limits, budget)
    with hold_folder(out), ExitStack() as stack:
        before = existing_run(out)
        if before is not None and _is_over(before, run, wanted):
            return before
        recorder = open_record(about, run, before, account, template, source, on_event)
        asking = account.budget, account.tariffs, retry or RetryPolicy()
        calls = Calls(recorder, *asking, wanted)
        dialogue = Dialogue(about, *models, calls, book, template)
        dialogue.begin()
        warm = judge or stack.enter_context(WarmJudge(task=about.task))
        race = run.iterations if run.search == RACE else 0
        parts = shares(run.episodes, wanted.improve, race)
        terms = Terms(recorder, warm, parts, wanted)
        return _run(dialogue, trials_of(about, terms), source)


def _models(wanted: SynthOptions, problem: Problem) -> tuple[Provider, Provider]:
    """The learner and the optimizer."""
    return choose_models(
        wanted.learner,
        wanted.optimizer,
        problem.setting,
        wanted.base_url,
        key_over_http=wanted.key_over_http,
    )


def book_of(rules: RuleBook | Path | None) -> RuleBook:
    """The rules to begin with: given, in a file, or none."""
    return read_given(rules) if isinstance(rules, Path) else rules or RuleBook()


def _check(wanted: SynthOptions, problem: Problem) -> None:
    """Checks numbers, and that a controller can be written.

    Raises:
        TaskError: A number is out of range, or the problem cannot be used.
    """
    for name, least in wanted.least.items():
        whole_number(name, getattr(wanted, name), least)
    if problem.has_hidden:
        whole_number("episodes", wanted.episodes or 0, 2, MOST_EPISODES)
        whole_number("feedback_episodes", wanted.feedback_episodes, 1, MOST_EPISODES)
    elif wanted.then_verify:
        raise TaskError(f"then_verify: {problem.called} has no hidden worlds")
    if wanted.improve:
        whole_number("improve", wanted.improve, LEAST_IMPROVE, MOST_EPISODES)
    more = wanted.search == RACE and (wanted.iterations or 0) > (wanted.candidates or 0)
    if (wanted.improve or more) and not kinds_of(wanted.ask):
        raise TaskError("ask: expected a kind of question, such as repair")
    if wanted.improve and wanted.search != RACE and RULES in kinds_of(wanted.ask):
        raise TaskError("ask: rules are for a race; leave them out, or give its search")
    if wanted.search == RACE:
        _check_race(wanted, problem)
    problem.check(wanted.improve)
    if isinstance(problem.task, Task):
        check_physics(problem.task, wanted.physics)


def _check_race(wanted: SynthOptions, problem: Problem) -> None:
    """Checks that a race has episodes, and that its options have an effect.

    Raises:
        TaskError: One of them cannot be used.
    """
    if problem.has_hidden and wanted.improve:
        raise TaskError(
            "improve: a race goes on after a success anyway; give more answers (-K) or "
            "episodes instead"
        )
    if not problem.has_hidden and not wanted.improve:
        raise TaskError(
            "search: a race on a task needs --improve N, the number of its disturbed "
            "episodes"
        )


def _recorded(
    wanted: SynthOptions,
    problem: Problem,
    models: Sequence[Provider],
    before: Run | None,
) -> dict[str, Any]:
    """What the record of a run keeps of its options."""
    kept = wanted.recorded("set" if problem.has_hidden else "task")
    facts = {name: value for name, value in kept.items() if name in Run.model_fields}
    facts["options"] = {n: value for n, value in kept.items() if n not in facts}
    if problem.has_hidden:
        known = before is not None and before.then_verify
        facts["then_verify"] = wanted.then_verify or known
    else:
        facts["confirm"] = wanted.confirm or (before is not None and before.confirm)
    # The worlds of a set, and the episodes of a search, follow from it.
    needed = problem.has_hidden or wanted.improve > 0
    facts["seed"] = settled_seed(wanted.seed, models[0], before, needed=needed)
    return facts


def _source(given: str | Path | None) -> str | None:
    """The source of an initial controller, or of the one in a file.

    Raises:
        ControllerFileError: The file cannot be read, or is not UTF-8.
    """
    if not isinstance(given, Path):
        return given
    try:
        return read_source(given).decode("utf-8")
    except UnicodeDecodeError as error:
        message = f"{given} is not UTF-8 text: {error.reason}"
        raise ControllerFileError(message) from error


def _is_over(before: Run, now: Run, wanted: SynthOptions) -> bool:
    """Whether nothing is left to do; what passed or was selected may be verified later.

    Raises:
        RunError: It is another run, or one that this installation did not begin.
    """
    check_same(before, now, wanted.identity)
    later = {
        "selected": now.then_verify,
        "passed": now.confirm and not before.confirmations,
    }
    over = before.finished and not later.get(before.status, False)
    if over:
        check_own(before)
    return over


def _run(dialogue: Dialogue, trials: Trials, given: str | None) -> Run:
    """Writes and delivers, and records how it ended."""
    recorder = trials.terms.recorder
    try:
        _write(dialogue, trials, given)
    except OutOfBudget as error:
        facts = {"reason": str(error), "outlook": error.outlook}
        recorder.finish("budget", error.way_on, **facts)
    except KeyboardInterrupt:
        recorder.finish("interrupted")
        raise
    except Exception as error:
        # On a full disk, the first error is the one to report.
        with suppress(OSError):
            recorder.finish("fault", reason=str(error))
        raise
    return recorder.run


def _write(dialogue: Dialogue, trials: Trials, given: str | None) -> None:
    """Writes controllers, selects one of them, and delivers it."""
    if dialogue.learner.paid or dialogue.optimizer.paid:
        trials.prove()
    search = _race if trials.terms.recorder.run.search == RACE else _loop
    found = search(dialogue, trials, given)
    validation, able = trials.terms.shares.validation, found.able
    if not validation:  # the tests have decided
        able.sort(key=lambda each: trials.result(each).rank, reverse=True)
    chosen = select(able, validation, trials.validate) if able else None
    if chosen is None or (validation and not chosen.score):
        reason = trials.why_none(able)
        trials.terms.recorder.finish("not verified", reason=reason)
        return
    race = found.archive, found.asked, found.stopped
    conclude(trials, Chosen(chosen, found.written, *race))


class _Found(NamedTuple):
    """What a search came to.

    Attributes:
        written: All candidates.
        able: Those to select from.
        stopped: What ended it early.
        archive: What a race came to; None without one.
        asked: Number of its questions that were answered.
    """

    written: list[Candidate]
    able: list[Candidate]
    stopped: str
    archive: Archive | None = None
    asked: int = 0


def _loop(dialogue: Dialogue, trials: Trials, given: str | None) -> _Found:
    """Algorithm 2: the iterations, then a race for improvements, if one is wanted."""
    loop = Iterations(dialogue, trials, given)
    written, stopped = loop.written, ""
    try:
        stopped = loop.run()
    except OutOfBudget as error:
        # With more money, the run can go on; what works for something is selected.
        if not any(trials.result(each).works for each in written):
            raise
        stopped = str(error)
    able = [each for each in written if not trials.result(each).unfit]
    works = any(trials.result(each).works for each in able)
    if not trials.terms.recorder.run.improve or not works:
        return _Found(written, able, stopped)
    trials.secure(max(able, key=lambda each: trials.result(each).rank))
    kinds = kinds_of(trials.terms.recorder.run.ask)
    most = trials.terms.shares.asked
    race = Race(dialogue, trials, written, most=most, kinds=kinds)
    race.begin_with(able)
    stopped = race.run(MOST_STALE) or stopped
    able = trials.finalists(race.archive)
    return _Found(written, able, stopped, race.archive, race.asked)


def _race(dialogue: Dialogue, trials: Trials, given: str | None) -> _Found:
    """First answers, and questions that build on them."""
    run, written = trials.terms.recorder.run, list[Candidate]()
    first = min(run.candidates, run.iterations)
    kinds, most = kinds_of(run.ask), run.iterations - first
    race = Race(dialogue, trials, written, most=most, kinds=kinds)
    parts = trials.terms.shares
    race.ask_first(given, min(first, parts.explore // parts.block))
    stopped = race.run()
    able = trials.finalists(race.archive) if race.archive.members else []
    return _Found(written, able, stopped, race.archive, race.asked)
