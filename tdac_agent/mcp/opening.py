"""Opens the run of a server: a new one, or the one that its folder contains."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from tdac_agent.errors import RunError
from tdac_agent.mcp.desk import Desk
from tdac_agent.mcp.on_set import OnSet
from tdac_agent.mcp.on_task import EPISODES_EACH, OnTask
from tdac_agent.mcp.watch import Watch
from tdac_agent.models.budget import Budget
from tdac_agent.prompting.prompt import FULL
from tdac_agent.prompting.set_prompt import check_generated, set_prompt
from tdac_agent.runs.ownership import remark_on
from tdac_agent.runs.recorder import Recorder
from tdac_agent.runs.resume import check_same, existing_run, recorded_task
from tdac_agent.runs.run_record import AGENT, Agent, Run
from tdac_agent.set_synthesis.delivery import start_on_set
from tdac_agent.set_synthesis.synthesize import FEEDBACK_EPISODES
from tdac_agent.set_synthesis.trials import MOST_EPISODES, Trials
from tdac_agent.synthesis.candidates import Tests
from tdac_agent.synthesis.setup import (
    Account,
    describe,
    hold_folder,
    new_run,
    open_record,
)
from tdac_agent.synthesis.workload import Shares
from tdac_agent.tasks.installation import drawn_seed, lasting_secret
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.task_file import SET_FILE
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_envs.core.arguments import whole_number
from tdac_envs.ladder.task_sets import TaskSet, load_set

EPISODES = 128
"""Default limit of simulated episodes."""
TIER = "auto"


@dataclass(frozen=True, slots=True)
class Outside:
    """The author of a run whose controllers come from an agent outside."""

    name: str = AGENT


@dataclass(frozen=True, slots=True)
class Begun:
    """What a run folder says about its run.

    Attributes:
        about: The task or the task set.
        episodes: The limit of episodes.
    """

    about: Task | TaskSet
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
    if run.on_set:
        assert run.episodes is not None
        return Begun(load_set(folder / SET_FILE), run.episodes)
    task = recorded_task(folder)
    if task.suite is not None:
        task = replace(task, trusted=True)  # its hash is part of the mark
    return Begun(task, run.iterations * EPISODES_EACH)


@contextmanager
def open_desk(
    about: Task | TaskSet, out: Path, episodes: int, agent: Agent
) -> Generator[Desk]:
    """Opens a run in a `with` block, in which no other process can use its folder.

    Args:
        about: The task or the task set.
        out: New or empty folder, or one with the same run.
        episodes: Most simulated episodes of all submissions.
        agent: How agents are connected.

    Raises:
        TaskError: The number of episodes is out of range.
        RunError: The folder cannot be used, or contains another run.
    """
    if isinstance(about, TaskSet):
        opening = _on_set(about, out, episodes)
    else:
        opening = _on_task(about, out, episodes)
    opening.run.agent = agent
    with hold_folder(out):
        # Other users of this machine must not read what an agent is not told.
        out.chmod(0o700)
        watch = Watch()
        recorder = _recorder(opening, existing_run(out))
        recorder.on_event = watch.record
        task = None if isinstance(about, TaskSet) else about
        with WarmJudge(task=task, watch=watch.poll) as judge:
            yield Desk(opening.judging(recorder, judge), watch)


@dataclass(frozen=True, slots=True)
class _Opening:
    """A run that is to be opened.

    Attributes:
        run: Its record, if it is new.
        start: Writes its files; see `open_record`.
        judging: Makes what judges its submissions.
    """

    run: Run
    start: Callable[..., None]
    judging: Callable[[Recorder, WarmJudge], OnTask | OnSet]


def _on_task(task: Task, out: Path, episodes: int) -> _Opening:
    whole_number("episodes", episodes, EPISODES_EACH, MOST_EPISODES)
    run = describe(
        task,
        (Outside(), Outside()),
        FULL,
        start_from=None,
        folder=out,
        iterations=episodes // EPISODES_EACH,
        patience=0,
        refine=False,
        seed=None if lasting_secret() is not None else drawn_seed(),
    )
    return _Opening(
        run,
        partial(Recorder.start, task=task, template=FULL, given=None),
        lambda recorder, judge: OnTask(recorder, Tests(task, judge, TIER)),
    )


def _on_set(tasks: TaskSet, out: Path, episodes: int) -> _Opening:
    whole_number("episodes", episodes, 1, MOST_EPISODES)
    check_generated(tasks)
    run = new_run(
        (Outside(), Outside()),
        set_prompt(tasks, (), FULL),
        None,
        task=tasks.name,
        task_sha256=tasks.sha256,
        profile="policy",
        folder=out,
        iterations=episodes,
        patience=0,
        refine=False,
        seed=drawn_seed(),
        episodes=episodes,
        feedback_episodes=FEEDBACK_EPISODES,
        then_verify=True,
    )

    def judging(recorder: Recorder, judge: WarmJudge) -> OnSet:
        block = FEEDBACK_EPISODES
        # All episodes are for feedback: the agent selects.
        parts = Shares(episodes, validation=0, explore=0, block=1, comparison=0)
        return OnSet(Trials(tasks, recorder, judge, TIER, block, parts))

    return _Opening(run, start_on_set(tasks, FULL, None), judging)


def _recorder(opening: _Opening, before: Run | None) -> Recorder:
    """The recorder of a new or resumed run; one that only reads, if it has ended."""
    run = opening.run
    if before is not None:
        run.seed = before.seed
        check_same(before, run)
        _check_ours(before)
        if before.finished:
            return Recorder(before)
        run.clients = before.clients
        if "unconfined" in (before.agent, run.agent):
            run.agent = "unconfined"
    account = Account(Budget(), {})
    return open_record(opening.start, run, before, account, None)


def _check_ours(before: Run) -> None:
    """Refuses a run of another installation, whose record is not trusted.

    Raises:
        RunError: Another installation began it.
    """
    remark = remark_on(before) if lasting_secret() is not None else ""
    if remark:
        raise RunError(f"{remark}: give a new folder with --out")
