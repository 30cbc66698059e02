"""Algorithm 2: test-driven synthesis of a controller."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

from tdac_agent.dialogue import Candidate, Dialogue
from tdac_agent.errors import RunError
from tdac_agent.figures import draw_trajectories
from tdac_agent.files import write_atomic
from tdac_agent.prompt import generate_prompt, load_template
from tdac_agent.provider import Provider
from tdac_agent.providers import choose_models
from tdac_agent.records import Event, Recorder, Run
from tdac_agent.report import Report
from tdac_agent.retry import RetryPolicy
from tdac_agent.suite_check import prove_suite
from tdac_agent.task import Task
from tdac_agent.verification import load_trajectories, verify
from tdac_agent.warm import WarmJudge


def synthesize(
    task: Task,
    learner: str | Provider = "builtin",
    optimizer: str | Provider | None = None,
    *,
    out: Path,
    iterations: int = 20,
    patience: int = 1,
    seed: int = 0,
    start_from: str | None = None,
    base_url: str | None = None,
    prompt: str = "full",
    retry: RetryPolicy | None = None,
    on_event: Event | None = None,
) -> Run:
    """Writes, tests and repairs controllers until one is verified.

    Args:
        task: What the controller must do.
        learner: LLM1 of the paper, writes controllers: a provider, or its name as in
            `anthropic:MODEL` (docs/models.md).
        optimizer: LLM2, edits code and writes rules; the learner by default.
        out: New or empty folder for the run.
        iterations: K.
        patience: J, edits per iteration.
        seed: Of the jittered starts.
        start_from: Source of a controller to begin with instead of a generated one.
        base_url: Where `anthropic:` or `openai:` models are served, else by the vendor.
        prompt: Template of the question for a new controller: `full`,
            `underspecified`, or a file (docs/prompts.md).
        retry: How patiently a model is asked after faults.
        on_event: Called with each journal record, if given.

    Returns:
        The run; `run.verified` tells whether `run.controller` was written.

    Raises:
        RunError: The folder cannot be used.
        ProviderError: A model cannot be chosen so, e.g. without its key.
        PromptError: The template cannot be used.
        Fault: Sandbox, suite or provider broken; the run's record says so, too.
    """
    template = load_template(prompt)
    generate_prompt(task, (), template)  # refuses a broken one before a folder is made
    first, second = choose_models(learner, optimizer, task.setting, base_url)
    run = Run(
        folder=out,
        task=task.name,
        task_sha256=task.sha256(),
        learner=first.name,
        optimizer=second.name,
        base_url=base_url,
        prompt=template.name,
        iterations=iterations,
        patience=patience,
        seed=seed,
        started=datetime.now(UTC).isoformat(timespec="seconds"),
    )
    recorder = _recorder(task, run, on_event)
    dialogue = Dialogue(
        task, first, second, recorder, retry=retry or RetryPolicy(), template=template
    )
    given = Candidate(start_from) if start_from is not None else None
    judge = WarmJudge()
    try:
        if first.paid or second.paid:
            _prove(task, seed, recorder, judge)
        for k in range(1, iterations + 1):
            candidate = given or dialogue.generate(k)
            given = None
            for j in range(patience + 1):
                source, notes = candidate
                if source is None:
                    recorder.judged(k, j, None, notes)
                    break
                folder = recorder.candidate(k, j, source)
                report = verify(
                    folder / "controller.py", task, seed=seed, out=folder, judge=judge
                )
                recorder.judged(k, j, report, notes)
                dialogue.saw(k, j, report)
                if report.passed:
                    return _deliver(recorder, task, k, source, report, folder)
                if j < patience:
                    candidate = dialogue.edit(k, j + 1, source, report)
                else:
                    dialogue.summarise(k, j, source, report)
        recorder.finish("not verified")
    except KeyboardInterrupt:
        recorder.finish("interrupted")
        raise
    except Exception as error:
        recorder.finish("fault", reason=str(error))
        raise
    finally:
        judge.close()
    return recorder.run


def _prove(task: Task, seed: int, recorder: Recorder, judge: WarmJudge) -> None:
    """Has the suite prove itself before an answer is paid for.

    Raises:
        Fault: It does not: no controller can pass it, or one that does nothing can.
    """
    recorder.event("prove.start")
    proof = prove_suite(task, seed=seed, judge=judge)
    facts = proof.model_dump(include={"suite", "suite_sha256", "sandbox", "proven"})
    recorder.event("prove.end", **facts)


def _deliver(
    recorder: Recorder, task: Task, k: int, source: str, report: Report, evidence: Path
) -> Run:
    """Puts the verified controller and its evidence at the top of the run."""
    folder = recorder.run.folder
    write_atomic(folder / "controller.py", source)
    write_atomic(folder / "report.json", report.model_dump_json(indent=2) + "\n")
    (folder / "trajectories").mkdir(exist_ok=True)
    for path in sorted((evidence / "trajectories").glob("*.npz")):
        write_atomic(folder / "trajectories" / path.name, path.read_bytes())
    outcomes = {episode.name: episode.outcome for episode in report.episodes}
    trajectories = load_trajectories(folder / "trajectories")
    draw_trajectories(task, trajectories, outcomes, folder / "trajectory.png")
    recorder.run.tau = k
    recorder.finish("verified", k=k)
    return recorder.run


def _recorder(task: Task, run: Run, on_event: Event | None) -> Recorder:
    """The recorder of a run, its folder made."""
    out = run.folder
    try:
        out.mkdir(parents=True, exist_ok=True)
        if any(out.iterdir()):
            raise RunError(f"the folder {out} is not empty; give a new one with --out")
        recorder = Recorder(run, on_event)
        recorder.start(task)
    except OSError as error:
        raise RunError(f"cannot write to {out}: {error.strerror}") from error
    return recorder
