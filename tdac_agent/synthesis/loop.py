"""Algorithm 2: test-driven synthesis of a controller."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

from tdac_agent.errors import Fault
from tdac_agent.models.budget import Budget
from tdac_agent.models.choice import choose_models
from tdac_agent.models.picture import LARGEST_SIDE
from tdac_agent.models.provider import MAX_OUTPUT_TOKENS, Provider
from tdac_agent.models.retry import RetryPolicy
from tdac_agent.prompting.extract import same_code
from tdac_agent.prompting.feedback import feedback_of
from tdac_agent.prompting.given_rules import given_lines
from tdac_agent.prompting.prompt import generate_prompt, load_template
from tdac_agent.prompting.rules import RuleBook
from tdac_agent.runs.recorder import Event, Recorder
from tdac_agent.runs.resume import check_own, check_same, existing_run
from tdac_agent.runs.run_record import Run
from tdac_agent.synthesis.calls import Calls, OutOfBudget
from tdac_agent.synthesis.candidates import (
    Tests,
    deliver,
    place,
    verify_all,
    verify_candidate,
)
from tdac_agent.synthesis.dialogue import Dialogue, ModelAnswer
from tdac_agent.synthesis.disturbed import MOST_EPISODES
from tdac_agent.synthesis.improve_task import TaskCandidate, improve_verified
from tdac_agent.synthesis.setup import (
    account_of,
    checked_vision,
    describe,
    hold_folder,
    open_record,
    settled_seed,
)
from tdac_agent.synthesis.workload import LEAST_IMPROVE
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.task import Task
from tdac_agent.verification.diagnosis.model_picture import (
    FailurePicture,
    failure_picture,
)
from tdac_agent.verification.diagnosis.report import Report
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.suite_check import prove_suite
from tdac_agent.verification.verify import load_trajectories
from tdac_envs.core.arguments import whole_number

MOST_SPENT = 3
"""Iterations in a row without code, after which a paid model is given up."""


def synthesize(
    task: Task,
    learner: str | Provider = "builtin",
    optimizer: str | Provider | None = None,
    *,
    out: Path,
    iterations: int = 20,
    patience: int = 1,
    candidates: int = 1,
    improve: int = 0,
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
    """Writes, tests and repairs controllers until one is verified, and improves it.

    If `out` contains the same run, unfinished, that run is resumed: recorded answers
    and verifications are reused (docs/models.md).

    Args:
        task: What the controller must do.
        learner: LLM1 of the paper, which writes controllers: a provider, or its name
            such as `anthropic:MODEL` (docs/models.md).
        optimizer: LLM2, which edits code and writes rules; the learner by default.
        out: New or empty folder for the run, or one with the same run.
        iterations: K, the maximum number of iterations.
        patience: J, edits per iteration.
        candidates: N, new controllers that are asked for side by side, each of them an
            iteration. They are judged in parallel, and the best one is repaired.
        improve: Simulated disturbed episodes (docs/robustness.md) for variations of
            verified candidates (`tdac_agent.synthesis.workload.task_shares`); 0 for
            none.
        seed: Seed of the jittered starts of all candidates. By default each candidate
            has its own, as for `verify`; a replay uses the seed of its recorded run.
            With `improve`, one for all is drawn; the disturbed episodes follow from it.
        start_from: Source of an initial controller instead of a generated one.
        base_url: Server of `anthropic:` or `openai:` models; by default the vendor's.
        key_over_http: Whether a key may be sent unencrypted to such a server on
            another machine.
        prompt: Template of the question for a new controller: `full`,
            `underspecified`, or a file (docs/prompts.md).
        refine: Whether failures become rules of the prompt for new controllers.
        rules: Rules to begin with (`read_given`); none by default.
        vision: Whether a picture of the failure goes with the feedback to the
            optimizer; never one of a held-out start.
        max_output: Token limit of an answer; twice that after a truncated answer.
        max_cost: Limit in USD; by default the one the run was begun with, or 2.
        max_tokens: Limit of input plus output; by default the earlier one, or none.
        budget: Budget shared with other runs, instead of these limits.
        index: Index among otherwise equal runs, which keeps their answers apart.
        retry: Retry policy after faults.
        tier: Sandbox tier of all candidates; `auto` for the best one on this machine.
            It is not recorded: a run folder cannot ask for a weaker one.
        judge: A warm judge, to reuse in consecutive runs; None starts one.
        on_event: Called with each journal record.

    Returns:
        The run; if `run.verified`, `run.controller` is the verified controller.

    Raises:
        TaskError: A number is out of range, or the environment has no disturbances.
        RunError: The folder cannot be used, or contains another run.
        ProviderError: A model cannot be used, e.g. without its key, or nothing bounds
            what it costs; or pictures would have no effect.
        PriceError: The user's price file is broken.
        PromptError: The template cannot be used.
        Fault: The sandbox, suite or provider is broken; the fault is also recorded.
    """
    if improve:
        whole_number("improve", improve, LEAST_IMPROVE, MOST_EPISODES)
        task.disturbed_options(Disturbance())
    template, book = load_template(prompt), rules or RuleBook()
    models = choose_models(
        learner, optimizer, task.setting, base_url, key_over_http=key_over_http
    )
    run = describe(
        task,
        models,
        template,
        folder=out,
        base_url=base_url,
        max_output=max_output,
        index=index,
        start_from=start_from,
        iterations=iterations,
        patience=patience,
        candidates=whole_number("candidates", candidates, 1),
        refine=refine,
        vision=checked_vision(vision, models[1].name, patience, improve),
        given_rules=given_lines(book),
        seed=settled_seed(seed, models[0], out, needed=improve > 0),
        improve=improve,
    )
    account = account_of(models, existing_run(out), max_cost, max_tokens, budget)
    with hold_folder(out):
        before = existing_run(out)
        if before is not None:
            check_same(before, run)
            if before.finished:
                check_own(before)
                return before
        start = partial(Recorder.start, task=task, template=template, given=start_from)
        recorder = open_record(start, run, before, account, on_event, task.suite)
        calls = Calls(
            recorder,
            account.budget,
            account.tariffs,
            retry or RetryPolicy(),
            max_output,
        )
        question = partial(generate_prompt, task, template=template)
        dialogue = Dialogue(question, *models, calls, book)
        dialogue.begin()
        paid = any(model.paid for model in models)
        with ExitStack() as stack:
            warm = judge or stack.enter_context(WarmJudge(task=task))
            return _run(dialogue, start_from, Tests(task, warm, tier), paid=paid)


def _run(dialogue: Dialogue, given: str | None, tests: Tests, *, paid: bool) -> Run:
    """Runs the loop, and records how it ended."""
    recorder = dialogue.calls.recorder
    try:
        if paid:
            _prove(recorder, tests)
        _search(dialogue, given, tests)
    except OutOfBudget as error:
        facts = {"enough": error.way_on, "outlook": error.outlook}
        recorder.finish("budget", reason=str(error), **facts)
    except KeyboardInterrupt:
        recorder.finish("interrupted")
        raise
    except Exception as error:
        # On a full disk, the first error is the one to report.
        with suppress(OSError):
            recorder.finish("fault", reason=str(error))
        raise
    return recorder.run


def _search(dialogue: Dialogue, given: str | None, tests: Tests) -> None:
    """Algorithm 2, until a candidate has passed or K iterations are over."""
    loop = _Loop(dialogue, tests)
    for ks, answers in dialogue.new_candidates(given):
        if loop.iteration(ks, answers):
            return
    dialogue.calls.recorder.finish("not verified")


@dataclass(frozen=True, slots=True)
class _Tested:
    """A candidate and its report."""

    k: int
    j: int
    source: str
    report: Report
    folder: Path


class _New(NamedTuple):
    """A new candidate (k, 0).

    Attributes:
        k: Its iteration.
        source: Its source.
        notes: Notes on the answer.
        folder: Its folder.
        same: Iteration of an earlier one of its group with the same code.
    """

    k: int
    source: str
    notes: tuple[str, ...]
    folder: Path
    same: int | None


class _Loop:
    """The state of the loop.

    Args:
        dialogue: The models.
        tests: Where candidates are tested.
    """

    def __init__(self, dialogue: Dialogue, tests: Tests) -> None:
        self._dialogue, self._tests = dialogue, tests
        self._recorder = dialogue.calls.recorder
        # Recorded answers do not count, so that a resumed run asks as often again.
        self._empty = 0
        # Verified ones beside the best of a group.
        self._others: list[_Tested] = []

    def iteration(self, ks: Sequence[int], answers: Sequence[ModelAnswer]) -> bool:
        """Tests new candidates, and repairs the best; returns whether one passed.

        Args:
            ks: Their iterations.
            answers: Their sources.
        """
        best = self._begin(ks, answers)
        if best is None:
            return False
        dialogue, run = self._dialogue, self._recorder.run
        k, source, report = best.k, best.source, best.report
        failure = feedback_of(report)
        for j in range(1, run.patience + 1):
            if report.passed:
                break
            parent, picture = source, self._picture(best)
            edited, notes = dialogue.edit(k, j, source, failure, picture)
            if edited is None:
                self._no_code(k, j, notes)
                return False
            source, self._empty = edited, 0
            folder = self._recorder.candidate(k, j, source)
            if same_code(source, parent):
                said = _same_as(k, j - 1)
                self._recorder.judged(k, j, report, (*notes, said), unchanged=True)
                dialogue.saw_no_change(k, j)
                continue
            report = verify_candidate(self._recorder, k, j, source, folder, self._tests)
            self._recorder.judged(k, j, report, notes)
            failure = feedback_of(report)
            dialogue.saw(k, j, failure)
            best = _Tested(k, j, source, report, folder)
        if report.passed:
            self._finish(best)
            return True
        if run.refine:
            dialogue.summarise(k, run.patience, source, failure)
        return False

    def _begin(
        self, ks: Sequence[int], answers: Sequence[ModelAnswer]
    ) -> _Tested | None:
        """Tests new candidates; returns the best one, or None if there is no code.

        Those with the same code are tested once.
        """
        begun: list[_New] = []
        for k, (source, notes) in zip(ks, answers, strict=True):
            if source is None:
                self._no_code(k, 0, notes)
                continue
            self._empty = 0
            folder = self._recorder.candidate(k, 0, source)
            first = (each.k for each in begun if same_code(source, each.source))
            begun.append(_New(k, source, notes, folder, next(first, None)))
        new = [each for each in begun if each.same is None]
        if not new:
            return None
        jobs = [(each.k, 0, each.source, each.folder) for each in new]
        reports = verify_all(self._recorder, jobs, self._tests)
        tested = [
            _Tested(each.k, 0, each.source, report, each.folder)
            for each, report in zip(new, reports, strict=True)
        ]
        by_k = {each.k: each.report for each in tested}
        for k, _, notes, _, same in begun:
            if same is None:
                self._recorder.judged(k, 0, by_k[k], notes)
                continue
            said = _same_as(same, 0)
            self._recorder.judged(k, 0, by_k[same], (*notes, said), unchanged=True)
            self._dialogue.saw_again(k, 0, (same, 0))
        best = min(tested, key=lambda each: (len(each.report.failures), each.k))
        self._others = [one for one in tested if one.report.passed and one is not best]
        # The next question is about the last one that was seen.
        for each in [*(one for one in tested if one is not best), best]:
            self._dialogue.saw(each.k, 0, feedback_of(each.report))
        return best

    def _picture(self, failed: _Tested) -> FailurePicture | None:
        """A picture of a failure, if the models are shown pictures."""
        if not self._recorder.run.vision:
            return None
        trajectories = load_trajectories(failed.folder / "trajectories")
        task = self._tests.task
        return failure_picture(task, failed.report, trajectories, LARGEST_SIDE)

    def _no_code(self, k: int, j: int, notes: tuple[str, ...]) -> None:
        """Records an answer without code.

        Raises:
            Fault: A paid model has given none in some iterations in a row.
        """
        new = self._recorder.judged(k, j, None, notes)
        self._empty += new and j == 0
        learner, most = self._dialogue.learner, self._recorder.run.iterations
        if learner.paid and self._empty >= MOST_SPENT and k < most:
            raise given_up(learner, self._empty, notes)

    def _finish(self, first: _Tested) -> None:
        """Delivers a verified candidate, or the best variation of it."""
        recorder, task = self._recorder, self._tests.task
        first_at = (first.source, first.report, first.folder)
        if not recorder.run.improve:
            deliver(recorder, task, first.k, *first_at)
            return
        # An interrupted search leaves a verified controller.
        place(recorder, task, *first_at)
        recorder.run.tau = first.k
        recorder.save()
        founders = [
            TaskCandidate(each.k, each.j, each.source, each.folder, each.report)
            for each in (first, *self._others)
        ]
        chosen, stopped = improve_verified(self._dialogue, self._tests, founders)
        if chosen is not founders[0]:
            assert chosen.report is not None
            place(recorder, task, chosen.source, chosen.report, chosen.folder)
        recorder.finish("verified", k=chosen.k, j=chosen.j, reason=stopped)


def _same_as(k: int, j: int) -> str:
    """What is noted on a candidate with the code of another one."""
    return f"same code as k={k} j={j}"


def given_up(model: Provider, count: int, notes: tuple[str, ...]) -> Fault:
    """The fault of a model that gives no code, with the note on its last answers."""
    return Fault(
        f"{model.name}: {count} iterations in a row without a controller; in the last "
        f"one, {notes[-1]}"
    )


def _prove(recorder: Recorder, tests: Tests) -> None:
    """Checks the test suite before an answer is paid for, once per run.

    Raises:
        Fault: The reference fails the suite, or a controller that does nothing passes.
    """
    # The record of another installation's run is not trusted.
    if recorder.past.proven and recorder.run.mark:
        return

    def tell(doing: str) -> None:
        recorder.tell({"event": "prove.step", "doing": doing})

    recorder.event("prove.start")
    seed, judge = recorder.run.seed, tests.judge
    proof = prove_suite(
        tests.task, tier=tests.tier, seed=seed, judge=judge, on_progress=tell
    )
    facts = proof.model_dump(include={"suite", "suite_sha256", "sandbox", "proven"})
    recorder.event("prove.end", **facts)
