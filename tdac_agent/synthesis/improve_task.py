"""Variations of a verified controller for one task, and the best one of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, astuple, dataclass
from pathlib import Path
from statistics import fmean

from tdac_agent.metrics.paired import paired_change
from tdac_agent.models.picture import LARGEST_SIDE
from tdac_agent.prompting.feedback import feedback_of
from tdac_agent.prompting.python_source import same_code
from tdac_agent.runs.episode_pictures import failure_pictures
from tdac_agent.runs.improvement_record import (
    IMPROVEMENT_FILE,
    MemberFigures,
    PairedChange,
    TaskImprovement,
    drive_text,
)
from tdac_agent.runs.recorder import Recorder
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.synthesis.archive import Member
from tdac_agent.synthesis.calls import OutOfBudget
from tdac_agent.synthesis.candidates import Tests, verify_candidate
from tdac_agent.synthesis.dialogue import Dialogue
from tdac_agent.synthesis.disturbed import (
    FAILURES,
    DisturbedEpisodes,
    DisturbedTrials,
    named,
)
from tdac_agent.synthesis.improve import FOUNDERS, Explored, ImprovingSearch
from tdac_agent.synthesis.workload import most_variations, task_shares
from tdac_agent.tasks.task import Task
from tdac_agent.verification.diagnosis.measures import least_steps
from tdac_agent.verification.diagnosis.model_picture import (
    FailurePicture,
)
from tdac_agent.verification.diagnosis.report import Report
from tdac_envs.ladder.scores import time_score

NOT_RUN = "not run"


@dataclass(frozen=True, slots=True)
class TaskFigures:
    """How a verified candidate drove; higher is better.

    Attributes:
        robustness: Share of the disturbed episodes that reached the goal.
        time: Mean time score of the disturbed episodes.
        nominal: Time score of the nominal episode.
        clearance: Mean of the least gaps between body and obstacles in the disturbed
            episodes, px or m; an episode that fails counts as 0.
    """

    robustness: float
    time: float
    nominal: float
    clearance: float
    ranked = ("goals reached", "mean time score")

    @classmethod
    def of(cls, task: Task, report: Report, driven: DisturbedEpisodes) -> TaskFigures:
        """The figures of a candidate.

        Args:
            task: The task.
            report: The report that verified it.
            driven: Its disturbed episodes.
        """
        nominal = next(each for each in report.episodes if each.name == "nominal")
        least = least_steps(task.nominal)
        return cls(
            fmean(driven.successes),
            fmean(driven.times),
            time_score(nominal.outcome == "reached", nominal.steps, least),
            fmean(each.gap_left for each in driven.episodes),
        )

    @property
    def values(self) -> tuple[float, ...]:
        """See `Figures`."""
        return astuple(self)

    @property
    def rank(self) -> tuple[float, ...]:
        """See `Figures`."""
        return self.robustness, self.time


@dataclass(slots=True)
class TaskCandidate:
    """A candidate of the search.

    Attributes:
        k: Its iteration.
        j: Its edit.
        source: Its source.
        folder: Its folder.
        report: Its report; None before it was tested.
        driven: Its disturbed episodes, if it is verified and has driven them.
    """

    k: int
    j: int
    source: str
    folder: Path
    report: Report | None = None
    driven: DisturbedEpisodes | None = None


@dataclass(slots=True)
class TaskExplorer:
    """Tests variations, and drives those that are verified; see `Explorer`.

    Attributes:
        trials: Drives candidates.
        most: Most variations that are asked for.
    """

    trials: DisturbedTrials
    most: int
    aim: str = (
        "Raise the number of goals that it reaches in disturbed episodes that nobody "
        "has seen yet, and then its mean time score. It must still pass all tests."
    )

    @property
    def recorder(self) -> Recorder:
        """See `Explorer`."""
        return self.trials.recorder

    def goes_on(self, asked: int) -> bool:
        """See `Explorer`."""
        return asked < self.most and self.trials.can_explore

    def made(self, k: int, source: str, folder: Path) -> TaskCandidate:
        """See `Explorer`."""
        return TaskCandidate(k, 0, source, folder)

    def explore(self, candidate: TaskCandidate) -> Explored:
        """See `Explorer`."""
        report = candidate.report
        varied = report is None
        if report is None:
            at = candidate.k, candidate.j, candidate.source, candidate.folder
            report = verify_candidate(self.recorder, *at, self.trials.tests)
            candidate.report = report
        seed = report.provenance.seed
        if not report.passed:
            found = feedback_of(report)
            drove = any(each.outcome != NOT_RUN for each in report.episodes)
            failed = found.failed
            return Explored(None, found.line, failed=failed, drove=drove, seed=seed)
        driven = candidate.driven = self.trials.explore(candidate)
        figures = TaskFigures.of(self.trials.tests.task, report, driven)
        if not varied:
            said = drive_text(figures.time, driven.reached, len(driven.episodes))
            about = {"k": candidate.k, "j": candidate.j, "said": said}
            self.recorder.tell({"event": "improve.begin", **about})
        return Explored(figures, driven.told, passed=True, seed=seed)

    def figures(
        self, member: Member[TaskCandidate], best: Member[TaskCandidate]
    ) -> list[str]:
        """See `Explorer`."""
        task, candidate = self.trials.tests.task, member.candidate
        assert candidate.report is not None
        assert candidate.driven is not None
        own = TaskFigures.of(task, candidate.report, candidate.driven)
        top = best.figures.rank
        clearance = task.setting.units.figure(own.clearance)
        return [
            "It passes all tests. In "
            f"{len(candidate.driven.episodes)} disturbed episodes, the same for all "
            f"controllers ({candidate.driven.disturbance}):",
            f"- goals reached: {own.robustness:.3f}; the best controller so far has "
            f"{top[0]:.3f}",
            f"- mean time score (success weighted by time): {own.time:.3f}; the best "
            f"controller so far has {top[1]:.3f}",
            f"- least gap between body and obstacles, on average: {clearance}",
            f"- time score of the episode without disturbances: {own.nominal:.3f}",
        ]

    def feedback(self, candidate: TaskCandidate) -> str | None:
        """See `Explorer`."""
        assert candidate.driven is not None
        return candidate.driven.feedback

    def picture(self, candidate: TaskCandidate) -> FailurePicture | None:
        """See `Explorer`."""
        assert candidate.driven is not None
        folder = candidate.folder / "improve" / FAILURES
        episodes = enumerate(candidate.driven.episodes, 1)
        each = ((named(number), episode) for number, episode in episodes)
        found = failure_pictures(self.trials.tests.task, each, folder, LARGEST_SIDE)
        return next((picture for _, picture in found), None)


def improve_verified(
    dialogue: Dialogue, tests: Tests, founders: Sequence[TaskCandidate]
) -> tuple[TaskCandidate, str]:
    """Varies verified candidates, and compares the best one with the first.

    Without money for further questions, it goes on with what there is.

    Args:
        dialogue: The models.
        tests: Where candidates are tested.
        founders: Verified candidates, the first one of the run first.

    Returns:
        The selected candidate (the best member of the archive, or the first one), and
        what ended the search early.
    """
    recorder = dialogue.calls.recorder
    run = recorder.run
    trials = DisturbedTrials(recorder, tests, task_shares(run.improve))
    explorer = TaskExplorer(trials, most_variations(run.improve, on_set=False))
    begun: list[TaskCandidate] = []
    for each in founders:
        if not any(same_code(each.source, one.source) for one in begun):
            begun.append(each)
    begun, stopped = begun[:FOUNDERS], ""
    search = ImprovingSearch(dialogue, explorer, begun)
    try:
        search.run(tuple(begun))
    except OutOfBudget as error:
        stopped = str(error)
    found = _compared(trials, search, stopped)
    write_atomic(run.folder / IMPROVEMENT_FILE, found.model_dump_json(indent=2) + "\n")
    facts = found.model_dump(mode="json", exclude={"members", "stopped"})
    recorder.event("select.end", **facts)
    return search.archive.best().candidate, stopped


def _compared(
    trials: DisturbedTrials, search: ImprovingSearch[TaskCandidate], stopped: str
) -> TaskImprovement:
    """The record of a search; the selected candidate drives beside the first one."""
    archive = search.archive
    first, chosen = archive.members[0].candidate, archive.best().candidate
    changes = dict[str, PairedChange]()
    if chosen is not first:
        before, after = trials.compare(first), trials.compare(chosen)
        pairs = {
            "robustness": (before.successes, after.successes),
            "time": (before.times, after.times),
        }
        changes = {
            name: PairedChange(**asdict(paired_change(*pair)))
            for name, pair in pairs.items()
        }
    driven = first.driven
    assert driven is not None
    return TaskImprovement(
        unit=trials.tests.task.setting.units.place,
        disturbance=driven.disturbance,
        first_seed=driven.first_seed,
        block=trials.shares.block,
        improve=trials.recorder.run.improve,
        used=trials.used,
        asked=search.asked,
        members=tuple(map(_figures, archive.members)),
        first=(first.k, first.j),
        k=chosen.k,
        j=chosen.j,
        controller_sha256=sha256_of(chosen.source),
        first_comparison=trials.first_seed("comparison"),
        episodes=trials.shares.comparison if changes else 0,
        stopped=stopped,
        **changes,
    )


def _figures(member: Member[TaskCandidate]) -> MemberFigures:
    candidate, parent, own = member.candidate, member.parent, member.figures
    names = ("robustness", "time", "nominal", "clearance")
    figures = dict(zip(names, own.values, strict=True))
    return MemberFigures(
        k=candidate.k,
        j=candidate.j,
        parent=None if parent is None else (parent.candidate.k, parent.candidate.j),
        controller_sha256=sha256_of(candidate.source),
        **{name: round(value, 6) for name, value in figures.items()},
    )
