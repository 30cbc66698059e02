"""Algorithm 2: test-driven synthesis of a controller."""

from __future__ import annotations

from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path

from tdac_agent.models.budget import Budget
from tdac_agent.models.choice import choose_models
from tdac_agent.models.provider import MAX_OUTPUT_TOKENS, Provider
from tdac_agent.models.retry import RetryPolicy
from tdac_agent.prompting.context import contract_of
from tdac_agent.prompting.given_rules import given_lines
from tdac_agent.prompting.prompt import generate_prompt, load_template
from tdac_agent.prompting.rules import RuleBook
from tdac_agent.runs.recorder import Event, Recorder
from tdac_agent.runs.resume import check_own, check_same, existing_run
from tdac_agent.runs.run_record import Run
from tdac_agent.synthesis.calls import Calls, OutOfBudget
from tdac_agent.synthesis.candidates import (
    Tests,
)
from tdac_agent.synthesis.dialogue import Dialogue
from tdac_agent.synthesis.disturbed import MOST_EPISODES
from tdac_agent.synthesis.iterations import Iterations
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
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.suite_check import prove_suite
from tdac_envs.core.arguments import whole_number


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
        recorder = open_record(start, run, before, account, on_event)
        calls = Calls(
            recorder,
            account.budget,
            account.tariffs,
            retry or RetryPolicy(),
            max_output,
        )
        question = partial(generate_prompt, task, template=template)
        contract = contract_of(task)
        dialogue = Dialogue(question, *models, calls, book, contract=contract)
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


def _search(dialogue: Dialogue, given: str | None, tests: Tests) -> None:
    """Algorithm 2, until a candidate has passed or K iterations are over."""
    loop = Iterations(dialogue, tests)
    for ks, answers in dialogue.new_candidates(given):
        if loop.iteration(ks, answers):
            return
    dialogue.calls.recorder.finish("not verified")


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
