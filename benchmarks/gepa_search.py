"""Our search for better controllers beside GEPA's, at equal numbers of episodes.

    python -m benchmarks.gepa_search OUT [--improve 384] [--pairs 8] [--processes 1]

`tdac synth --improve` and `optimize_anything` of the package `gepa` begin with the same
weak controller, propose by the same draws (`tdac_agent.builtin.variation`: one or two
constants are multiplied by random factors), and may simulate the same number of
episodes: what `--improve` leaves after the final comparison. Both measure candidates on
the same worlds of `dev`. Ours spends a sixth of the episodes on selecting among its
finalists, on further worlds of `dev`. GEPA tries each proposal on three worlds first,
and drives on the others only if it was better there. GEPA has its defaults but for the
proposer, the cache and the end: no episode is driven or counted twice, and it ends when
another candidate might exceed the number. Its objectives are figures of our archive.

Start and winners then drive on the same worlds of `test`, which decided nothing. A pair
is a start with a seed, with worlds of its own: the pairs are independent, and the
intervals are those of a paired bootstrap over them.

The controllers are the planner `dwa` of `tdac bench` on the level `unknown`, with
settings drawn from the ranges of `planners.yaml` until one is weak: a mean time score
between two limits on eight worlds of `dev`. (The built-in controllers are no ground for
this: other constants hardly change their scores, or break them.) They are driven
without the sandbox (`benchmarks/in_process.py`): there are thousands of episodes.

`OUT/pairs.csv` has a row for each pair. After an interruption, the same command
continues. Needs the package `gepa`, as in the extra `bench`.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import tempfile
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from itertools import count
from pathlib import Path
from statistics import fmean
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from benchmarks.in_process import Drives
from benchmarks.timing import whole_from_one
from benchmarks.tune_planners import drawn
from tdac_agent.builtin.variation import varied
from tdac_agent.metrics.paired import bootstrap
from tdac_agent.planners.planner import ranges_of, source_of, with_values
from tdac_agent.runs.recorder import Recorder
from tdac_agent.runs.run_record import Run
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.synthesis.candidates import Candidate
from tdac_agent.synthesis.dialogue import ModelAnswer
from tdac_agent.synthesis.improve import ImprovingSearch
from tdac_agent.synthesis.options import SynthOptions
from tdac_agent.synthesis.selection import select
from tdac_agent.synthesis.terms import Terms as TrialTerms
from tdac_agent.synthesis.workload import Shares, shares
from tdac_agent.synthesis.world_trials import (
    BLOCKS,
    PURPOSES,
    WorldTrials,
    first_world,
)
from tdac_agent.verification.episode_report import (
    EpisodeProvenance,
    EpisodeReport,
    summarise,
)
from tdac_agent.verification.judge.episode_row import EpisodeRow
from tdac_envs.ladder.task_sets import TaskSet, load_set

LEVEL, PLANNER = "unknown", "dwa"
WEAK = 0.1, 0.45
"""Limits of the mean time score of a start; most settings have more."""
SCREENED = 8
"""Worlds that tell whether a start is weak."""
OPTIONS = SynthOptions(tier="none", feedback_episodes=SCREENED)
SEARCHES = "ours", "gepa"
PAIRS = "pairs.csv"
Drive = Callable[[str, str, int], EpisodeRow]
"""The episode of a controller on a world of a split."""


class Found(NamedTuple):
    """What a search came to.

    Attributes:
        source: The best controller.
        episodes: Episodes that it took.
        tried: Number of proposals.
    """

    source: str
    episodes: int
    tried: int


class Terms(NamedTuple):
    """What both searches of a pair share.

    Attributes:
        tasks: The task set.
        start: The weak controller.
        seed: Of worlds and draws.
        improve: As in `tdac synth --improve`.
        drive: Drives an episode.
    """

    tasks: TaskSet
    start: str
    seed: int
    improve: int
    drive: Drive

    @property
    def shares(self) -> Shares:
        """How the episodes are divided."""
        return shares(0, self.improve)

    @property
    def episodes(self) -> int:
        """Most episodes of a search."""
        return self.shares.explore + self.shares.validation

    def worlds(self, purpose: str, number: int) -> list[int]:
        """Numbers of worlds of `dev`."""
        first = PURPOSES.index(purpose) * BLOCKS + first_world(self.seed, 0)
        return list(range(first, first + number))

    def report(self, source: str, worlds: Sequence[int]) -> EpisodeReport:
        """How a controller drives on worlds of `dev`."""
        episodes = [self.drive(source, "dev", index) for index in worlds]
        about = EpisodeProvenance(
            name=self.tasks.name,
            sha256=self.tasks.sha256,
            dynamics=self.tasks.dynamics,
            split="dev",
            controller_sha256=sha256_of(source.encode()),
            sandbox="none",
            limits={},
            versions={},
        )
        return summarise(about, episodes, None, 0.0)

    def variation(self, source: str, number: int) -> str:
        """The proposal with a number, from 1."""
        return varied(source, (0, self.seed, number))[0]


class _Trials(WorldTrials):
    """Drives in this process."""

    def __init__(self, pair: Terms, recorder: Recorder) -> None:
        parts = TrialTerms(recorder, None, pair.shares, OPTIONS)
        super().__init__(pair.tasks, parts)
        self._pair = pair

    def _drive(
        self,
        candidate: Candidate,
        purpose: str,
        first: int,
        count: int,
        out: str,  # noqa: ARG002
    ) -> EpisodeReport:
        report = self._pair.report(candidate.source, range(first, first + count))
        self.used[purpose] += report.count
        return report


class _Proposals:
    """Answers instead of a model."""

    def __init__(self, terms: Terms) -> None:
        self._terms, self.made = terms, 0

    def improve(self, _: int, source: str, *__: object) -> ModelAnswer:
        self.made += 1
        return ModelAnswer(self._terms.variation(source, self.made))


def by_ours(terms: Terms) -> Found:
    """The search and the selection of `tdac synth --improve`."""
    with tempfile.TemporaryDirectory(prefix="tdac-search-") as name:
        run = Run(
            folder=Path(name),
            task=terms.tasks.name,
            task_sha256=terms.tasks.sha256,
            dynamics=terms.tasks.dynamics,
            learner="builtin",
            optimizer="builtin",
            iterations=1,
            patience=0,
            seed=terms.seed,
            started="",
        )
        recorder, proposals = Recorder(run), _Proposals(terms)
        trials = _Trials(terms, recorder)
        start = Candidate(
            1, 0, terms.start, recorder.candidate(1, 0, terms.start, before="")
        )
        # Its score in the loop; there, it is no part of the budget of `--improve`.
        start.feedback.append(
            terms.report(terms.start, terms.worlds("feedback", SCREENED))
        )
        search = ImprovingSearch(proposals, trials, [start])
        search.run([start])
        able = trials.finalists(search.archive)
        chosen = select(able, terms.shares.validation, trials.validate)
    used = trials.used["improve"] + trials.used["validation"]
    return Found(chosen.source, used, proposals.made)


class _Quiet:
    """A log of GEPA that nobody reads."""

    def log(self, message: str) -> None:
        """Keeps nothing."""


def by_gepa(terms: Terms) -> Found:
    """The search of `optimize_anything`."""
    from gepa.optimize_anything import (
        EngineConfig,
        GEPAConfig,
        ReflectionConfig,
        TrackingConfig,
        optimize_anything,
    )

    numbers, used, tried = count(1), 0, 0

    def evaluate(candidate: str, example: int) -> tuple[float, dict[str, Any]]:
        nonlocal used
        used += 1
        found = terms.drive(candidate, "dev", example)
        figures = {
            "time": found.time_score,
            "path": found.path_score,
            "success": float(found.success),
        }
        return found.time_score, {"scores": figures}

    def propose(
        candidate: dict[str, str], _: object, names: list[str]
    ) -> dict[str, str]:
        nonlocal tried
        tried = next(numbers)
        return {name: terms.variation(candidate[name], tried) for name in names}

    block = terms.shares.block
    config = GEPAConfig(
        engine=EngineConfig(
            seed=terms.seed,
            parallel=False,
            cache_evaluation=True,
            use_cloudpickle=False,
        ),
        reflection=ReflectionConfig(
            reflection_lm=None, custom_candidate_proposer=propose
        ),
        tracking=TrackingConfig(logger=_Quiet()),
        # A proposal that is accepted takes so many; `max_metric_calls` would count
        # cached ones, too, and is exceeded.
        stop_callbacks=lambda _: used + block > terms.episodes,
    )
    result = optimize_anything(
        terms.start,
        evaluator=evaluate,
        dataset=terms.worlds("improve", block),
        config=config,
    )
    return Found(str(result.best_candidate), used, tried)


def weak_start(terms: Terms) -> str:
    """The first setting of the planner that is weak."""
    rng, ranges = np.random.default_rng([1, terms.seed]), ranges_of(PLANNER)
    worlds = terms.worlds("feedback", SCREENED)
    while True:
        source = with_values(source_of(PLANNER), drawn(ranges, rng))
        scores = [terms.drive(source, "dev", index).time_score for index in worlds]
        if WEAK[0] <= fmean(scores) <= WEAK[1]:
            return source


def compare(number: int, improve: int, worlds: int) -> dict[str, Any]:
    """The row of a pair."""
    drive = Drives(LEVEL)
    terms = Terms(load_set(LEVEL), "", number, improve, drive)
    terms = terms._replace(start=weak_start(terms))
    found = {"ours": by_ours(terms), "gepa": by_gepa(terms)}
    sources = {"start": terms.start} | {name: found[name].source for name in SEARCHES}
    row: dict[str, Any] = {"pair": number, "improve": improve}
    for name in SEARCHES:
        row[f"{name}_episodes"] = found[name].episodes
        row[f"{name}_tried"] = found[name].tried
    tested = range(number * worlds, (number + 1) * worlds)
    row["worlds"] = worlds
    for name, source in sources.items():
        episodes = [drive(source, "test", index) for index in tested]
        row[name] = fmean(each.time_score for each in episodes)
        row[f"{name}_reached"] = fmean(each.success for each in episodes)
    return row


def kept(job: tuple[Path, int, int, int]) -> dict[str, Any]:
    """The row of a pair, which an interrupted call may have kept."""
    out, number, improve, worlds = job
    file = out / "pairs" / f"{number}-{improve}-{worlds}.json"
    if not file.is_file():
        file.parent.mkdir(parents=True, exist_ok=True)
        write_atomic(file, json.dumps(compare(number, improve, worlds)) + "\n")
    row: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return row


def show(table: pd.DataFrame) -> None:
    """Prints mean time scores, and their differences with 95 % intervals."""
    names = "start", *SEARCHES
    means = bootstrap({name: table[name].to_numpy(float)[None] for name in names})
    shown = Table("mean time score", box=SIMPLE)
    for heading in ("value", "95 % interval", "p"):
        shown.add_column(heading, justify="right")
    rows = {name: (means[name], "") for name in names}
    for one, other in (("ours", "start"), ("gepa", "start"), ("gepa", "ours")):
        change = means[one].minus(means[other])
        rows[f"{one} − {other}"] = change, f"{change.p_value():.3f}"
    for name, (value, p) in rows.items():
        found = value.estimate()
        between = f"{found.low:.3f} to {found.high:.3f}"
        shown.add_row(name, f"{found.value:.3f}", between, p)
    console = Console()
    console.print(shown)
    console.print(
        f"{len(table)} pairs, {table['worlds'].iloc[0]} worlds of `test` each"
    )
    for name in SEARCHES:
        episodes, tried = (table[f"{name}_{what}"] for what in ("episodes", "tried"))
        said = f"{episodes.mean():.0f} episodes, {tried.mean():.1f} proposals a pair"
        console.print(f"{name}: {said}")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.gepa_search")
    parser.add_argument("out", type=Path)
    parser.add_argument("--improve", type=whole_from_one, default=384)
    parser.add_argument("--pairs", type=whole_from_one, default=8)
    parser.add_argument("--worlds", type=whole_from_one, default=40)
    parser.add_argument("--processes", type=whole_from_one, default=1)
    options = parser.parse_args()
    if find_spec("gepa") is None:
        sys.exit("the package gepa is missing: pip install gepa")
    out = options.out.resolve()
    jobs = [(out, k, options.improve, options.worlds) for k in range(options.pairs)]
    # Small matrices: more threads would only disturb others. Read by new processes.
    os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"
    rows = []
    with multiprocessing.get_context("spawn").Pool(options.processes) as pool:
        for row in pool.imap(kept, jobs, chunksize=1):
            rows.append(row)
            print(row, flush=True)
            write_atomic(out / PAIRS, pd.DataFrame(rows).to_csv(index=False))
    show(pd.DataFrame(rows))


if __name__ == "__main__":
    main()
