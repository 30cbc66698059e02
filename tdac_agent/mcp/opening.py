"""Opens the run of a server: a new one, or the one that its folder contains."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tdac_agent.errors import RunError
from tdac_agent.mcp.session import Session
from tdac_agent.mcp.watch import Watch
from tdac_agent.models.budget import Budget
from tdac_agent.problems.choice import kept_problem, problem_of
from tdac_agent.problems.problem import Problem
from tdac_agent.prompting.prompt import FULL
from tdac_agent.runs.ownership import remark_on
from tdac_agent.runs.recorder import Recorder
from tdac_agent.runs.resume import check_same, existing_run
from tdac_agent.runs.run_record import AGENT, Agent, Run
from tdac_agent.synthesis.options import PAPER, USUAL, SynthOptions
from tdac_agent.synthesis.setup import Account, hold_folder, new_run, open_record
from tdac_agent.synthesis.terms import Terms
from tdac_agent.synthesis.trials import trials_of
from tdac_agent.synthesis.workload import MOST_EPISODES, Shares
from tdac_agent.tasks.installation import drawn_seed, lasting_secret
from tdac_agent.tasks.task import Task
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.suite.starts import JITTERS
from tdac_envs.core.arguments import whole_number
from tdac_envs.ladder.task_sets import TaskSet

EPISODES = USUAL[PAPER]["episodes"]
"""Default limit of simulated episodes."""
FEEDBACK_EPISODES = SynthOptions().feedback_episodes
"""Most episodes of a submission on a task set."""
EPISODES_EACH = 1 + JITTERS
"""Episodes of a submission on a task: from the nominal start, and jittered ones."""
TIER = "auto"


@dataclass(frozen=True, slots=True)
class Outside:
    """The author of a run whose controllers come from an agent outside."""

    name: str = AGENT


@dataclass(frozen=True, slots=True)
class Begun:
    """What a run folder says about its run.

    Attributes:
        problem: What its submissions are for.
        episodes: The limit of episodes.
    """

    problem: Problem
    episodes: int


def begun(folder: Path) -> Begun | None:
    """The run of `tdac mcp` that a folder contains; None if it contains none.

    Raises:
        RunError: It cannot be read, or another installation began it.
        TaskError: Its task or task set cannot be read.
    """
    run = existing_run(folder)
    if run is None or run.learner != AGENT:
        return None
    _check_ours(run)
    problem = kept_problem(folder)
    if problem is None:
        raise RunError(
            f"the run in {folder} ended before its files were written: give --task or "
            "--set again"
        )
    # The hash of its own tests is part of the mark.
    episodes = run.episodes or run.iterations * EPISODES_EACH
    return Begun(problem.permitted(None), episodes)


@contextmanager
def open_session(
    about: Task | TaskSet | Problem, out: Path, episodes: int, agent: Agent
) -> Generator[Session]:
    """Opens a run in a `with` block, in which no other process can use its folder.

    Args:
        about: What the submissions are for.
        out: New or empty folder, or one with the same run.
        episodes: Most simulated episodes of all submissions.
        agent: How agents are connected.

    Raises:
        TaskError: The number of episodes is out of range.
        RunError: The folder cannot be used, or contains another run.
    """
    problem = problem_of(about)
    run = _new_run(problem, out, episodes)
    run.agent = agent
    with hold_folder(out):
        # Other users of this machine must not read what an agent is not told.
        out.chmod(0o700)
        watch = Watch()
        recorder = _recorder(problem, run, existing_run(out))
        recorder.on_event = watch.record
        # All episodes are for feedback: the agent selects.
        parts = Shares(
            run.episodes or 0, validation=0, explore=0, block=1, comparison=0
        )
        with WarmJudge(task=problem.task, watch=watch.poll) as judge:
            terms = Terms(recorder, judge, parts, SynthOptions(tier=TIER))
            yield Session(problem, trials_of(problem, terms), watch)


def _new_run(problem: Problem, out: Path, episodes: int) -> Run:
    """The record of a new run."""
    each = 1 if problem.has_hidden else EPISODES_EACH
    whole_number("episodes", episodes, each, MOST_EPISODES)
    problem.check()
    own_seeds = lasting_secret() is not None
    facts: dict[str, Any] = {"seed": None if own_seeds else drawn_seed()}
    facts["confirm"] = not problem.has_hidden
    if problem.has_hidden:
        facts |= {"seed": drawn_seed(), "episodes": episodes, "then_verify": True}
        facts["feedback_episodes"] = FEEDBACK_EPISODES
    return new_run(
        problem,
        (Outside(), Outside()),
        FULL,
        folder=out,
        iterations=episodes // each,
        patience=0,
        refine=False,
        **facts,
    )


def _recorder(problem: Problem, run: Run, before: Run | None) -> Recorder:
    """The recorder of a new or resumed run; one that only reads, if it has ended."""
    if before is not None:
        run.seed = before.seed
        check_same(before, run)
        _check_ours(before)
        if before.finished:
            return Recorder(before)
        run.clients = before.clients
        if "unconfined" in (before.agent, run.agent):
            run.agent = "unconfined"
    return open_record(problem, run, before, Account(Budget(), {}))


def _check_ours(before: Run) -> None:
    """Refuses a run of another installation, whose record is not trusted.

    Raises:
        RunError: Another installation began it.
    """
    remark = remark_on(before) if lasting_secret() is not None else ""
    if remark:
        raise RunError(f"{remark}: give a new folder with --out")
