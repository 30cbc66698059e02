"""Drives verified candidates in disturbed episodes, and counts these."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from pydantic import ConfigDict, Field, ValidationError

from tdac_agent.prompting.feedback import cut
from tdac_agent.runs.improvement_record import goals_text
from tdac_agent.runs.recorder import Recorder
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.hashes import number_of, sha256_of
from tdac_agent.storage.printable_record import PrintableRecord
from tdac_agent.synthesis.archive import Candidate
from tdac_agent.synthesis.candidates import Tests
from tdac_agent.synthesis.workload import Shares
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.provenance import versions
from tdac_agent.verification.judge.episode_row import EpisodeRow
from tdac_agent.verification.verify_episodes import verify_episodes
from tdac_envs.core.intake import RECORD_BYTES, parse_json, read_file

PURPOSES = ("improve", "comparison")
"""What the episodes are for, in the order of their seeds."""
FIRST_SEED = 2**33
"""Greater than the seeds that `tdac verify --robust` chooses by default."""
SEEDS = 2**32
"""Number of seeds for each purpose."""
MOST_EPISODES = 100_000
MOST_TOLD = 3
"""Failures whose diagnosis is told."""
EPISODES_FILE = "disturbed.json"
FAILURES = "trajectories"
"""Folder with the trajectories of failed episodes."""


def named(number: int) -> str:
    """Name of an episode in texts and pictures, by its number from 1."""
    return f"disturbed episode {number}"


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
    episodes: tuple[EpisodeRow, ...]

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
    def failed(self) -> dict[str, int]:
        """Number of failures by cause."""
        failed = (each for each in self.episodes if not each.success)
        causes = Counter(str(each.cause or each.outcome) for each in failed)
        return dict(causes.most_common())

    @property
    def feedback(self) -> str | None:
        """Causes of failures, and diagnoses of some; None without a failure."""
        causes = [f"{count} {cause}" for cause, count in self.failed.items()]
        if not causes:
            return None
        texts = [
            each.text.replace(f"seed {each.seed}", named(number), 1)
            for number, each in enumerate(self.episodes, 1)
            if each.text
        ]
        parts = [f"{self.told[0].upper()}{self.told[1:]}; {', '.join(causes)}."]
        parts += [f"{n}. {cut(text)}" for n, text in enumerate(texts[:MOST_TOLD], 1)]
        return "\n\n".join(parts)


@dataclass(slots=True)
class DisturbedTrials:
    """Drives candidates; all of them have the same seeds.

    Attributes:
        recorder: Records the run.
        tests: The task, the judge and the sandbox tier.
        shares: How the episodes are divided.
        used: Number of episodes that were driven.
    """

    recorder: Recorder
    tests: Tests
    shares: Shares
    used: int = 0

    @property
    def can_explore(self) -> bool:
        """Whether there are episodes for another variation."""
        return self.used + self.shares.block <= self.shares.explore

    def explore(self, candidate: Candidate) -> DisturbedEpisodes:
        """Drives the episodes for variations."""
        return self._drive(candidate, "improve", self.shares.block)

    def compare(self, candidate: Candidate) -> DisturbedEpisodes:
        """Drives the episodes of the comparison at the end, which decide nothing."""
        return self._drive(candidate, "comparison", self.shares.comparison)

    def first_seed(self, purpose: str) -> int:
        """Seed of the first episode for a purpose; the others count up from it."""
        run = self.recorder.run
        number = number_of(f"disturbed|{run.seed}|{run.index}")
        first = number % (SEEDS - MOST_EPISODES)
        return FIRST_SEED + PURPOSES.index(purpose) * SEEDS + first

    def _drive(
        self, candidate: Candidate, purpose: str, count: int
    ) -> DisturbedEpisodes:
        """Drives episodes; those on record are reused."""
        about = {"k": candidate.k, "j": candidate.j, "what": purpose, "episodes": count}
        self.recorder.event("drive.start", **about)
        out, first = candidate.folder / purpose, self.first_seed(purpose)
        found = None
        if self.recorder.vouches(out / EPISODES_FILE):
            found = self._kept(out, candidate, first, count)
        if found is None:
            found = self._driven(candidate, out, range(first, first + count), about)
        self.used += count
        self.recorder.event("drive.end", **about, reached=found.reached)
        return found

    def _driven(
        self, candidate: Candidate, out: Path, seeds: range, about: dict[str, object]
    ) -> DisturbedEpisodes:
        task = self.tests.task
        source = candidate.source.encode("utf-8", "surrogatepass")
        out.mkdir(exist_ok=True)
        report = verify_episodes(
            source,
            task,
            len(seeds),
            first=seeds.start,
            tier=self.tests.tier,
            out=out,
            trajectories=True,
            judge=self.tests.judge,
            watch=lambda done, reached: self.recorder.tell(
                {"event": "drive.step", **about, "done": done, "reached": reached}
            ),
        )
        found = DisturbedEpisodes(
            task_sha256=task.sha256(),
            controller_sha256=sha256_of(source),
            disturbance=Disturbance(),
            first_seed=seeds.start,
            sandbox=report.provenance.sandbox,
            versions=dict(versions()),
            episodes=report.episodes,
        )
        write_atomic(out / EPISODES_FILE, found.model_dump_json(indent=2) + "\n")
        self.recorder.vouch(out / EPISODES_FILE)
        return found

    def _kept(
        self, out: Path, candidate: Candidate, first: int, count: int
    ) -> DisturbedEpisodes | None:
        """The episodes in a folder if they are complete and of this candidate."""
        try:
            content = parse_json(read_file(out / EPISODES_FILE, RECORD_BYTES))
            found = DisturbedEpisodes.model_validate(content)
        except (OSError, ValueError, ValidationError):
            return None
        source = candidate.source.encode("utf-8", "surrogatepass")
        wanted = {
            "task_sha256": self.tests.task.sha256(),
            "controller_sha256": sha256_of(source),
            "disturbance": Disturbance(),
            "first_seed": first,
            "versions": dict(versions()),
        }
        same = all(getattr(found, name) == value for name, value in wanted.items())
        seeds = [each.seed for each in found.episodes]
        return found if same and seeds == list(range(first, first + count)) else None
