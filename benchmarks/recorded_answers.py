"""Judges recorded answers of models on hidden worlds, beside our own controllers.

    python -m benchmarks.recorded_answers judge ANSWERS OUT [--levels L...] [-n 200]
    python -m benchmarks.recorded_answers stability OUT OTHER

`judge` reads ANSWERS/LEVEL/NAME/reply.md, extracts each file as `tdac synth` does, and
drives it and `builtin` on the first N hidden worlds of a salt, which it draws and keeps
in OUT/sealed. Among movers, it also drives `builtin` without what it sees of them. A
program that no model wrote is ANSWERS/LEVEL/NAME/controller.py. After an interruption,
the same command continues. At the end the salt is revealed: OUT has `salt.hex`,
`results.csv` with a row for each file, and `worlds.csv` with a row for each episode.
`ahead` is by how much the mean time score of `builtin` is above that of the file, with
the 95 % interval of a paired bootstrap over worlds.

`stability` compares two such folders, of two salts: Kendall's tau of the mean time
scores of each level, and the pairs whose paired intervals say opposite things.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from tdac_agent.builtin.level import LEVELS
from tdac_agent.prompting.extract import extract_source
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.verification.episode_report import EpisodeReport
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.salt import SEALED, drawn_salt
from tdac_agent.verification.store import REPORT_FILE, ROWS_FILE
from tdac_agent.verification.verify_episodes import verify_episodes
from tdac_envs.ladder.task_sets import load_set

BUILTIN = "builtin"
BLIND = "builtin, blind to movers"
SEEN = {"moving": 'STATE["discs"], pose)', "crowd": 'STATE["people"], pose)'}
"""What `builtin` knows of movers when it chooses an action."""
RESULTS, WORLDS, SALT = "results.csv", "worlds.csv", "salt.hex"
FIGURES = ("index", "generator", "outcome", "steps", "time_score", "path_score")


def sources(answers: Path, level: str) -> Iterator[tuple[str, str | None]]:
    """Name and source of each entrant of a level; None for an answer without a file."""
    own = (LEVELS / f"{level}.py").read_text(encoding="utf-8")
    yield BUILTIN, own
    if level in SEEN:
        assert SEEN[level] in own
        yield BLIND, own.replace(SEEN[level], "[], pose)")
    for file in sorted((answers / level).glob("*/controller.py")):
        yield file.parent.name, file.read_text(encoding="utf-8")
    for reply in sorted((answers / level).glob("*/reply.md")):
        yield reply.parent.name, extract_source(reply.read_text(encoding="utf-8"))


def judge(answers: Path, out: Path, levels: list[str], worlds: int) -> None:
    """Drives all entrants, and writes what came out."""
    out.mkdir(parents=True, exist_ok=True)
    salt = drawn_salt(out / SEALED, reuse=True)
    rows, episodes = [], []
    with WarmJudge() as warm:
        for level in levels:
            first: pd.DataFrame | None = None
            for name, source in sources(answers, level):
                if source is None:
                    rows.append({"level": level, "entrant": name, "refused": "no file"})
                    continue
                kept = out / SEALED / level / name
                report = driven_on(source, level, worlds, salt, kept, warm)
                driven = episodes_in(kept) if report.count else None
                rows.append(_row(level, name, report, driven, first))
                print(rows[-1], flush=True)
                if driven is not None:
                    first = driven if first is None else first
                    driven.insert(0, "entrant", name)
                    driven.insert(0, "level", level)
                    episodes.append(driven)
    write_atomic(out / RESULTS, pd.DataFrame(rows).to_csv(index=False))
    write_atomic(out / WORLDS, pd.concat(episodes).to_csv(index=False))
    write_atomic(out / SALT, salt.read_bytes().hex() + "\n")


def driven_on(
    source: str, level: str, worlds: int, salt: Path, kept: Path, warm: WarmJudge
) -> EpisodeReport:
    """The report of an entrant, which an interrupted run may have kept."""
    tasks = load_set(level)
    raw = source.encode("utf-8", "surrogatepass")
    file = kept / REPORT_FILE
    if file.is_file():
        report = EpisodeReport.model_validate_json(file.read_bytes())
        about = {"controller_sha256": sha256_of(raw), "dynamics": tasks.dynamics}
        known = report.provenance.model_dump(include=set(about))
        if known == about and report.count == worlds:
            return report
    return verify_episodes(
        raw, tasks, worlds, split="hidden", salt_file=salt, out=kept, judge=warm
    )


def episodes_in(kept: Path) -> pd.DataFrame:
    rows = pd.read_json(kept / SEALED / ROWS_FILE, lines=True)
    return rows[list(FIGURES)]


def _row(
    level: str,
    name: str,
    report: EpisodeReport,
    driven: pd.DataFrame | None,
    builtin: pd.DataFrame | None,
) -> dict[str, Any]:
    about = report.provenance
    row: dict[str, Any] = {"level": level, "entrant": name}
    row["refused"] = "; ".join(report.told) if report.refused else ""
    if driven is not None and report.scores is not None and report.interval is not None:
        row |= {"worlds": report.count, "success": report.scores.success}
        row |= {"low": report.interval.low, "high": report.interval.high}
        row |= {"time_score": report.scores.time, "path_score": report.scores.path}
        row["failures"] = ", ".join(f"{n} {name}" for name, n in report.causes.items())
        if builtin is not None:
            ahead = (builtin["time_score"] - driven["time_score"]).to_numpy()
            row |= {"ahead": ahead.mean()}
            row |= dict(zip(("ahead_low", "ahead_high"), interval(ahead), strict=True))
    row |= {"set_sha256": about.sha256, "salt_sha256": about.salt_sha256}
    row |= {"dynamics": about.dynamics}
    return row | {"controller_sha256": about.controller_sha256}


def interval(differences: NDArray[np.float64]) -> tuple[float, float]:
    """95 % interval of the mean of paired differences, by bootstrap over worlds."""
    found = stats.bootstrap(
        (differences,), np.mean, n_resamples=9999, method="percentile", rng=0
    ).confidence_interval
    return float(found.low), float(found.high)


def stability(out: Path, other: Path) -> int:
    """Prints how well two salts agree; returns the number of pairs that do not."""
    tables = [pd.read_csv(folder / WORLDS) for folder in (out, other)]
    opposite = 0
    for level in dict.fromkeys(tables[0]["level"]):
        one, two = (
            table[table["level"] == level].pivot_table(
                index="index", columns="entrant", values="time_score"
            )
            for table in tables
        )
        names = [name for name in one.columns if name in two.columns]
        tau = stats.kendalltau(one[names].mean(), two[names].mean()).statistic
        told = 0
        for a, b in combinations(names, 2):
            bounds = [interval((t[a] - t[b]).to_numpy()) for t in (one, two)]
            signs = [(low > 0) - (high < 0) for low, high in bounds]
            means = [float((t[a] - t[b]).mean()) for t in (one, two)]
            told += any(signs)
            # A pair that one salt tells apart has the same sign on the other.
            if any(sign and sign * mean <= 0 for sign in signs for mean in means):
                opposite += 1
                print(f"{level}: {a} and {b} change places: {bounds}")
        pairs = len(names) * (len(names) - 1) // 2
        print(
            f"{level}: {len(names)} entrants, Kendall's tau {tau:.2f}; {told} of "
            f"{pairs} pairs told apart"
        )
    return opposite


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.recorded_answers")
    parts = parser.add_subparsers(dest="what", required=True)
    judged = parts.add_parser("judge")
    judged.add_argument("answers", type=Path)
    judged.add_argument("out", type=Path)
    levels = [path.stem for path in sorted(LEVELS.glob("*.py"))]
    judged.add_argument("--levels", nargs="+", choices=levels, default=levels)
    judged.add_argument("-n", "--worlds", type=int, default=200)
    both = parts.add_parser("stability")
    both.add_argument("out", type=Path)
    both.add_argument("other", type=Path)
    options = parser.parse_args()
    if options.what == "judge":
        judge(options.answers, options.out, options.levels, options.worlds)
    else:
        raise SystemExit(1 if stability(options.out, options.other) else 0)


if __name__ == "__main__":
    main()
