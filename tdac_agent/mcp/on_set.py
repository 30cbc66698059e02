"""Submissions for a task set, which drive on worlds of `dev` within a budget."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tdac_agent.environments.epuck.pictures import WorldPictures
from tdac_agent.environments.map2d.pictures import MapPictures
from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.errors import RunError
from tdac_agent.mcp.answers import ChooseAnswer, EpisodeAnswer, Judged, Left, Refused
from tdac_agent.mcp.judging import Submission
from tdac_agent.prompting.prompt import FULL
from tdac_agent.prompting.set_prompt import set_prompt
from tdac_agent.runs.recorder import Recorder
from tdac_agent.runs.run_record import Attempt
from tdac_agent.runs.selection_record import HIDDEN_FILE
from tdac_agent.set_synthesis.delivery import deliver_selected
from tdac_agent.set_synthesis.feedback import set_feedback, summary_of
from tdac_agent.set_synthesis.hidden import verify_hidden
from tdac_agent.set_synthesis.trials import SET_REPORT, Candidate, Trials
from tdac_agent.verification.diagnosis.figures import contact_of
from tdac_agent.verification.episode_report import EpisodeReport, decision_text
from tdac_agent.verification.judge.episode_row import EpisodeRow
from tdac_agent.verification.store import TRAJECTORIES
from tdac_envs.core.intake import RECORD_BYTES, parse_json, read_file
from tdac_envs.drawing.canvas import Image
from tdac_envs.drawing.closeup import Event, run_picture
from tdac_envs.ladder.task_sets import AnyTask
from tdac_envs.map2d.task import Map2DTask
from tdac_envs.mapping.map_folder import png

FEEDBACK = "feedback-1"
"""Subfolder with the episodes of a submission."""
MAX_FACT = 240


@dataclass(slots=True)
class OnSet:
    """See `Judging`.

    Attributes:
        trials: Drives submissions; all episodes are for feedback.
        candidates: The submissions so far, by number.
    """

    trials: Trials
    candidates: dict[int, Candidate] = field(default_factory=dict)

    @property
    def recorder(self) -> Recorder:
        """See `Judging`."""
        return self.trials.recorder

    @property
    def about(self) -> str:
        """See `Judging`."""
        return f"the task set {self.trials.tasks.name}"

    def question(self) -> str:
        """See `Judging`."""
        return set_prompt(self.trials.tasks, (), FULL)

    def left(self, submissions: int) -> Left:
        """See `Judging`."""
        most = self.recorder.run.iterations
        return Left(max(0, most - submissions), self.trials.feedback_left)

    def judge(self, number: int, source: str, folder: Path) -> Judged:
        """See `Judging`."""
        candidate = Candidate(number, 0, source, folder)
        report = self.trials.drive_next(candidate)
        self.candidates[number] = candidate
        failed = tuple(report.causes)
        if report.refused:
            failed = set_feedback(report).failed
        attempt = Attempt(
            k=number,
            j=0,
            valid=True,
            passed=not failed,
            failed_tests=failed,
            notes=(summary_of(report),),
        )
        self.recorder.attempted(attempt)
        return _judged(number, report)

    def recorded(self, number: int, folder: Path) -> Judged:
        """See `Judging`."""
        report = _report(folder / FEEDBACK / SET_REPORT)
        self.trials.feedback_left -= report.count
        return _judged(number, report)

    def picture(self, submission: Submission, episode: str) -> bytes:
        """See `Judging`."""
        report = _report(submission.folder / FEEDBACK / SET_REPORT)
        found = {str(each.index): each for each in report.episodes}
        figures = found.get(episode.strip().lower().removeprefix("world").strip())
        if figures is None:
            known = ", ".join(found) or "none: no episode was driven"
            raise Refused(f"there is no episode {episode[:80]!r}; those are {known}")
        name = f"{figures.number}.npz"
        try:
            place = submission.folder / FEEDBACK / TRAJECTORIES / name
            trajectory = Trajectory.load(place)
        except RunError as error:
            raise Refused(f"there is no record of world {figures.number}") from error
        task = self.trials.tasks.task("dev", figures.number)
        return png(_picture(task, trajectory, figures))

    def choose(self, submission: Submission) -> None:
        """See `Judging`."""
        trials, recorder = self.trials, self.recorder
        chosen = self.candidates[submission.number]
        deliver_selected(trials, list(self.candidates.values()), chosen, "")
        recorder.run.tau = chosen.k
        report = verify_hidden(
            trials.tasks, recorder, chosen.source, trials.judge, trials.tier
        )
        status = "verified" if report.passed else "not verified"
        recorder.finish(status, k=chosen.k, j=chosen.j)  # type: ignore[arg-type]

    def verdict(self, number: int) -> ChooseAnswer:
        """See `Judging`."""
        report = _report(self.recorder.run.folder / HIDDEN_FILE)
        parts = [
            f"the goal reached in {report.successes} of {report.count} hidden worlds"
        ]
        if report.refused:
            parts = ["the static and contract tests refused the file"]
        if report.sequential is not None:
            parts.append(decision_text(report.sequential).rstrip(","))
        if report.causes:
            counts = (f"{count} {name}" for name, count in report.causes.items())
            parts.append(f"failures: {', '.join(counts)}")
        return ChooseAnswer(
            submission=number,
            verified=report.passed,
            summary="; ".join(parts),
            worlds=report.count,
            reached=report.successes,
        )


def _report(path: Path) -> EpisodeReport:
    return EpisodeReport.model_validate(parse_json(read_file(path, RECORD_BYTES)))


def _judged(number: int, report: EpisodeReport) -> Judged:
    summary = summary_of(report)
    if report.scores is not None:
        summary += f"; mean score {report.scores.time:.3f}"
    all_reached = not report.refused and report.successes == report.count
    failures = f"nothing failed: {summary}; only choose({number}) can verify it"
    return Judged(
        False,
        summary,
        failures if all_reached else set_feedback(report).text,
        tuple(
            EpisodeAnswer(name=str(each.index), outcome=each.outcome, steps=each.steps)
            for each in report.episodes
        ),
        "the static and contract tests refused it" if report.refused else "",
    )


def _picture(task: AnyTask, trajectory: Trajectory, figures: EpisodeRow) -> Image:
    """The world with the robot's path; for a failure, also a close-up of its end."""
    name = f"world {figures.number}"
    if figures.success:
        return _whole(task, trajectory, figures.outcome, name)
    text = (figures.text or figures.error or "").replace("°", " deg")
    title = f"{name}: {figures.cause or figures.outcome}"
    fact = text.removeprefix(f"{title}: ").partition(". ")[0]
    fact = fact.encode("ascii", "replace").decode()[:MAX_FACT]
    event = Event(
        title=title,
        facts=(fact, f"ended in step {trajectory.steps}"),
        where=np.asarray(trajectory.poses[-1:, :2]),
        contact=contact_of(task, trajectory, figures.outcome),
        movers=trajectory.ghosts(trajectory.steps),
    )
    return run_picture(_pictures_of(task).backdrop(), trajectory.poses, event)


def _whole(task: AnyTask, trajectory: Trajectory, outcome: str, name: str) -> Image:
    movers = trajectory.ghosts(trajectory.steps)
    pictures = _pictures_of(task)
    return pictures.trajectories([trajectory.poses], [outcome], [name], movers)


def _pictures_of(task: AnyTask) -> MapPictures | WorldPictures:
    return MapPictures(task) if isinstance(task, Map2DTask) else WorldPictures(task)
