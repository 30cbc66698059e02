"""Disturbed episodes of candidates for a task, and their record."""

from __future__ import annotations

import hashlib
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from statistics import fmean

from pydantic import ConfigDict, Field, ValidationError

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.errors import RunError
from tdac_agent.models.picture import LARGEST_SIDE
from tdac_agent.prompting.feedback import cut
from tdac_agent.runs.improvement_record import goals_text
from tdac_agent.runs.run_record import Run
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.printable_record import PrintableRecord
from tdac_agent.synthesis.candidates import Figures
from tdac_agent.synthesis.workload import MOST_EPISODES
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.provenance import sha256_of, versions
from tdac_agent.tasks.task import Task
from tdac_agent.verification.diagnosis.figures import EpisodeFigures
from tdac_agent.verification.diagnosis.measures import least_steps
from tdac_agent.verification.diagnosis.model_picture import (
    FailurePicture,
    episode_picture,
)
from tdac_agent.verification.diagnosis.report import Report
from tdac_agent.verification.judge.seeded import ScoredEpisode
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.seeded_run import controller_job, run_seeds
from tdac_envs.core.intake import RECORD_BYTES, parse_json, read_file
from tdac_envs.ladder.scores import time_score

PURPOSES = ("improve", "comparison")
"""What the episodes are for, in the order of their seeds."""
FIRST_SEED = 2**33
"""Greater than the seeds that `tdac verify --robust` chooses by default."""
SEEDS = 2**32
"""Number of seeds for each purpose."""
MOST_TOLD = 3
"""Failures whose diagnosis is told."""
EPISODES_FILE = "disturbed.json"
RANKED = {"robustness": "goals reached", "time": "mean time score"}
FAILURES = "failures"
"""Folder with the trajectories of failed episodes."""


def named(number: int) -> str:
    """Name of an episode in texts and pictures, by its number from 1."""
    return f"disturbed episode {number}"


def seeds_for(run: Run, purpose: str, count: int) -> range:
    """The seeds of the episodes of a run for a purpose."""
    digest = hashlib.sha256(f"disturbed|{run.seed}|{run.index}".encode()).digest()
    first = int.from_bytes(digest[:8], "big") % (SEEDS - MOST_EPISODES)
    first += FIRST_SEED + PURPOSES.index(purpose) * SEEDS
    return range(first, first + count)


class DisturbedEpisodes(PrintableRecord):
    """Episodes with consecutive seeds, as those of `tdac verify --robust`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    schema_version: int = 1
    task_sha256: str
    controller_sha256: str
    disturbance: Disturbance
    first_seed: int
    sandbox: str = Field(description="Sandbox tier.")
    versions: dict[str, str]
    episodes: tuple[ScoredEpisode, ...]

    @property
    def reached(self) -> int:
        """Number of episodes that reached the goal without a contact."""
        return sum(each.success for each in self.episodes)

    @property
    def successes(self) -> list[float]:
        """1 for each episode that reached the goal, else 0."""
        return [float(each.success) for each in self.episodes]

    @property
    def times(self) -> list[float]:
        """Time score of each episode."""
        return [each.time_score for each in self.episodes]

    @property
    def told(self) -> str:
        """The result in one line."""
        return goals_text(self.reached, len(self.episodes))

    @property
    def feedback(self) -> str | None:
        """Causes of failures, and diagnoses of some; None without a failure."""
        failed = (each for each in self.episodes if not each.success)
        causes = Counter(str(each.cause or each.outcome) for each in failed)
        if not causes:
            return None
        counts = ", ".join(f"{count} {cause}" for cause, count in causes.most_common())
        texts = [
            each.diagnosis.text.replace(f"seed {each.seed}", named(number), 1)
            for number, each in enumerate(self.episodes, 1)
            if each.diagnosis
        ]
        parts = [f"{self.told[0].upper()}{self.told[1:]}; {counts}."]
        parts += [f"{n}. {cut(text)}" for n, text in enumerate(texts[:MOST_TOLD], 1)]
        return "\n\n".join(parts)


def drive_disturbed(
    source: bytes,
    task: Task,
    seeds: range,
    out: Path,
    *,
    judge: WarmJudge,
    tier: str,
    watch: Callable[[int, int], None],
) -> DisturbedEpisodes:
    """Drives disturbed episodes, and keeps them in a folder.

    Args:
        source: Source of the controller.
        task: The task.
        seeds: A seed for each episode.
        out: The folder.
        judge: A warm judge.
        tier: Sandbox tier.
        watch: Called repeatedly with the numbers of episodes and successes so far.
    """
    out.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="tdac-improve-") as name:
        job = controller_job(
            Path(name),
            source,
            task,
            Disturbance(),
            seeds,
            tier=tier,
            failures=(out / FAILURES).resolve(),
        )
        ended, ending = run_seeds(job, task.nominal, ScoredEpisode, judge, watch)
    found = DisturbedEpisodes(
        task_sha256=task.sha256(),
        controller_sha256=sha256_of(source),
        disturbance=job.disturbance,
        first_seed=seeds.start,
        sandbox=ending.tier,
        versions=dict(versions()),
        episodes=tuple(ended),
    )
    write_atomic(out / EPISODES_FILE, found.model_dump_json(indent=2) + "\n")
    return found


def kept_disturbed(
    folder: Path, source: bytes, task: Task, seeds: range
) -> DisturbedEpisodes | None:
    """The episodes in a folder if they are complete, and of this controller."""
    try:
        content = parse_json(read_file(folder / EPISODES_FILE, RECORD_BYTES))
        found = DisturbedEpisodes.model_validate(content)
    except (OSError, ValueError, ValidationError):
        return None
    wanted = {
        "task_sha256": task.sha256(),
        "controller_sha256": sha256_of(source),
        "disturbance": Disturbance(),
        "first_seed": seeds.start,
        "versions": dict(versions()),
    }
    same = all(getattr(found, name) == value for name, value in wanted.items())
    own = [each.seed for each in found.episodes]
    return found if same and own == list(seeds) else None


def task_figures(task: Task, report: Report, driven: DisturbedEpisodes) -> Figures:
    """Share of goals, mean time score, time of the nominal episode, clearance.

    Args:
        task: The task.
        report: The report that verified the candidate.
        driven: Its disturbed episodes.
    """
    nominal = next(each for each in report.episodes if each.name == "nominal")
    least = least_steps(task.nominal)
    figures = {
        "robustness": fmean(driven.successes),
        "time": fmean(driven.times),
        "nominal": time_score(nominal.outcome == "reached", nominal.steps, least),
        "clearance": fmean(each.clearance for each in driven.episodes),
    }
    return Figures(figures, RANKED)


def failed_picture(
    task: Task, driven: DisturbedEpisodes, folder: Path
) -> FailurePicture | None:
    """A picture of the first failed episode that drove; None if there is none."""
    for number, each in enumerate(driven.episodes, 1):
        if each.success:
            continue
        try:
            trajectory = Trajectory.load(folder / FAILURES / f"{each.seed}.npz")
        except RunError:  # it did not drive
            continue
        figures = EpisodeFigures(named(number), each.outcome, each.d0, each.d_min)
        return episode_picture(task, figures, each.diagnosis, trajectory, LARGEST_SIDE)
    return None
