"""Submissions for one task, which its suite verifies."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.errors import RunError
from tdac_agent.mcp.answers import ChooseAnswer, EpisodeAnswer, Judged, Left, Refused
from tdac_agent.mcp.judging import Submission
from tdac_agent.prompting.feedback import render_feedback
from tdac_agent.prompting.prompt import generate_prompt
from tdac_agent.runs.recorder import Recorder
from tdac_agent.synthesis.candidates import Tests, deliver, verify_candidate
from tdac_agent.tasks.task import display_name
from tdac_agent.verification.diagnosis.figures import file_stem
from tdac_agent.verification.diagnosis.report import Report
from tdac_agent.verification.suite.starts import JITTERS
from tdac_envs.core.intake import IMAGE_BYTES, RECORD_BYTES, parse_json, read_file
from tdac_envs.mapping.map_folder import png

EPISODES_EACH = 1 + JITTERS
"""Episodes of a submission: from the nominal start, and from jittered ones."""


@dataclass(slots=True)
class OnTask:
    """See `Judging`."""

    recorder: Recorder
    tests: Tests

    @property
    def about(self) -> str:
        """See `Judging`."""
        return f"the task {display_name(self.tests.task)}"

    def question(self) -> str:
        """See `Judging`."""
        return generate_prompt(self.tests.task, ())

    def left(self, submissions: int) -> Left:
        """See `Judging`."""
        return Left(max(0, self.recorder.run.iterations - submissions))

    def judge(self, number: int, source: str, folder: Path) -> Judged:
        """See `Judging`."""
        report = verify_candidate(self.recorder, number, 0, source, folder, self.tests)
        self.recorder.judged(number, 0, report, ())
        return _judged(report)

    def recorded(self, number: int, folder: Path) -> Judged:
        """See `Judging`."""
        del number
        return _judged(_report(folder / "report.json"))

    def picture(self, submission: Submission, episode: str) -> bytes:
        """See `Judging`."""
        name = episode.strip().lower().replace("_", " ")
        known = {each.name: each for each in submission.judged.episodes}
        folder = submission.folder / "trajectories"
        if name not in known:
            if (folder / f"{file_stem(name)}.npz").is_file():
                raise Refused(
                    f"{name} is a held-out start: only whether it passed is told"
                )
            raise Refused(_unknown(episode, list(known)))
        drawn = folder / f"{file_stem(name)}.png"
        if drawn.is_file():  # of each failed episode
            return read_file(drawn, IMAGE_BYTES)
        try:
            trajectory = Trajectory.load(folder / f"{file_stem(name)}.npz")
        except RunError as error:
            raise Refused(f"there is no record of {name}") from error
        movers = trajectory.ghosts(trajectory.steps)
        pictures = self.tests.task.pictures()
        outcome = known[name].outcome
        return png(pictures.trajectories([trajectory.poses], [outcome], [name], movers))

    def choose(self, submission: Submission) -> None:
        """See `Judging`."""
        folder = submission.folder
        report = _report(folder / "report.json")
        deliver(
            self.recorder,
            self.tests.task,
            submission.number,
            submission.source,
            report,
            folder,
        )

    def verdict(self, number: int) -> ChooseAnswer:
        """See `Judging`."""
        run = self.recorder.run
        return ChooseAnswer(
            submission=number,
            verified=run.verified,
            summary=f"submission {number} is the verified controller of this run",
            worlds=None,
            reached=None,
        )


def _unknown(episode: str, known: list[str]) -> str:
    if not known:
        return "there is no picture: no episode was driven"
    return f"there is no episode {episode[:80]!r}; expected one of {', '.join(known)}"


def _report(path: Path) -> Report:
    return Report.model_validate(parse_json(read_file(path, RECORD_BYTES)))


def _judged(report: Report) -> Judged:
    passed, verdict = report.passed, report.verdict
    summary = f"{verdict.passed_tests} of {verdict.expected} tests passed"
    if not passed:
        summary = f"{len(report.failures)} of {verdict.expected} tests failed"
        if verdict.passed_tests == 0:
            summary += f", the first because {report.failures[0].message}"
    return Judged(
        passed,
        summary,
        "nothing failed: it is verified" if passed else render_feedback(report),
        tuple(
            EpisodeAnswer(name=each.name, outcome=each.outcome, steps=each.steps)
            for each in report.episodes
            if not each.held_out and each.outcome != "not run"
        ),
        "" if passed else f"{summary}; only a verified submission can be chosen",
    )
