"""What the loop adds to a model's first answers, at equal numbers of episodes.

    python -m benchmarks.loop_gain OUT [--levels L...] [-n 100]

`results/ladder/loops/LEVEL/N` has runs of `tdac synth --set LEVEL --episodes 128`. The
first candidate and the selected one of each drive on the first N hidden worlds of the
salt on which the first answers were judged (`results/ladder/genuine/figures/LEVEL`).

Best of N: the first answers drive on `dev` worlds, 128 episodes together, and the best
one is taken. Its score is that of the same hidden worlds.

OUT/gain.csv has a row for each run: scores, paired differences with 95 % intervals
by bootstrap over worlds, candidates, and characters asked and answered; OUT/gain.md is
the same as a table. After an interruption, the same command continues.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from benchmarks.recorded_answers import driven_on, episodes_in, interval
from tdac_agent.prompting.extract import extract_source
from tdac_agent.storage.files import write_atomic
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.store import kept_report
from tdac_agent.verification.verify_episodes import verify_episodes
from tdac_envs.ladder.task_sets import TaskSet, load_set

RESULTS = Path("results/ladder")
EPISODES = 128
SALT = "salt"


def gains(level: str, worlds: int, out: Path, judge: WarmJudge) -> list[dict[str, Any]]:
    """A row for each run of a level."""
    tasks, salt = load_set(level), out / SALT / level
    figures = RESULTS / "genuine" / "figures" / level
    salt.parent.mkdir(parents=True, exist_ok=True)
    salt.write_bytes(bytes.fromhex((figures / "salt.hex").read_text()))
    best, best_scores = best_of_n(tasks, figures, worlds, out, judge)
    rows = []
    for run in sorted((RESULTS / "loops" / level).iterdir()):
        report = json.loads((run / "report.json").read_text())
        files = candidate(run, 1, 0), candidate(run, report["k"], report["j"])
        first, last = (
            hidden_scores(file, level, worlds, salt, out, judge) for file in files
        )
        row: dict[str, Any] = {
            "level": level,
            "run": run.name,
            "selected": f"k={report['k']} j={report['j']}",
            "candidates": len(report["candidates"]),
            "episodes": report["feedback_used"] + report["validation_used"],
            "asked": characters(run, "prompt"),
            "answered": characters(run, "reply"),
            "first": first.mean(),
            "last": last.mean(),
            "best_of_n": best_scores.mean(),
            "n": best,
        }
        for name, before in (("first", first), ("best_of_n", best_scores)):
            low, high = interval(last - before)
            row |= {f"over_{name}": (last - before).mean()}
            row |= {f"over_{name}_low": low, f"over_{name}_high": high}
        rows.append(row)
        print(row, flush=True)
    return rows


def characters(run: Path, what: str) -> int:
    """Characters of all prompts or all replies of a run."""
    return sum(len(file.read_text()) for file in run.rglob(f"*.{what}*.md"))


def best_of_n(
    tasks: TaskSet, figures: Path, worlds: int, out: Path, judge: WarmJudge
) -> tuple[str, NDArray[np.float64]]:
    """The first answer that is best on `dev`, with its scores on hidden worlds."""
    table = pd.read_csv(figures / "worlds.csv")
    replies = sorted((RESULTS / "genuine" / tasks.name).glob("*/reply.md"))
    judged = [file for file in replies if int(file.parent.name) in _names(table)]
    share = EPISODES // len(judged)
    means = []
    for file in judged:
        source = extract_source(file.read_text(encoding="utf-8"))
        assert source is not None
        raw = source.encode()
        kept = out / "dev" / tasks.name / sha256_of(raw)[:16]
        about = {"controller_sha256": sha256_of(raw), "dynamics": tasks.dynamics}
        known = kept_report(kept, {**about, "split": "dev"}, range(share))
        report = known or verify_episodes(
            raw, tasks, share, split="dev", out=kept, judge=judge
        )
        means.append(np.mean([each.time_score for each in report.episodes]))
    best = judged[int(np.argmax(means))].parent.name
    own = table[(table["entrant"] == best) & (table["index"] < worlds)]
    scores = own.sort_values("index")["time_score"].to_numpy(np.float64)
    assert len(scores) == worlds
    return f"{best} of {len(judged)}", scores


def _names(table: pd.DataFrame) -> set[int]:
    """Numbers of the answers in a table of worlds."""
    return {int(name) for name in table["entrant"].unique() if str(name).isdecimal()}


def hidden_scores(
    file: Path, level: str, worlds: int, salt: Path, out: Path, judge: WarmJudge
) -> NDArray[np.float64]:
    """Time scores of a candidate on hidden worlds."""
    source = file.read_text(encoding="utf-8")
    kept = out / "hidden" / level / sha256_of(source.encode())[:16]
    driven_on(source, level, worlds, salt, kept, judge)
    return episodes_in(kept)["time_score"].to_numpy(np.float64)


def table(rows: Sequence[dict[str, Any]]) -> str:
    """The rows in Markdown, and the mean differences of runs with a repair."""
    heads = (
        "level",
        "run",
        "candidates",
        "episodes",
        "asked",
        "answered",
        "first candidate",
        "selected",
        "selected - first",
        "best of N",
        "selected - best of N",
    )
    lines = [f"| {' | '.join(heads)} |", f"|---|{'---:|' * (len(heads) - 1)}"]
    for row in rows:
        cells = [f"`{row['level']}`", row["run"], row["candidates"], row["episodes"]]
        cells += [f"{row[name] / 1000:.0f} k" for name in ("asked", "answered")]
        cells += [f"{row[name]:.3f}" for name in ("first", "last")]
        cells += [
            _difference(row, "first"),
            f"{row['best_of_n']:.3f} (answer {row['n']})",
        ]
        cells += [_difference(row, "best_of_n")]
        lines.append(f"| {' | '.join(map(str, cells))} |")
    lines.append("")
    repaired = [row for row in rows if row["candidates"] > 1]
    for name, words in (("first", "the first candidate"), ("best_of_n", "best of N")):
        over = np.array([row[f"over_{name}"] for row in repaired], np.float64)
        p = stats.wilcoxon(over).pvalue
        lines.append(
            f"With repairs, selected - {words}: {over.mean():+.3f}, "
            f"{(over > 0.0).sum()} of {len(over)} above 0 "
            f"(p = {p:.2g}, Wilcoxon's signed-rank test)."
        )
    return "\n".join(lines) + "\n"


def _difference(row: dict[str, Any], name: str) -> str:
    over = f"over_{name}"
    return f"{row[over]:+.3f} ({row[f'{over}_low']:+.3f} to {row[f'{over}_high']:+.3f})"


def candidate(run: Path, k: int, j: int) -> Path:
    """File of a candidate of a run."""
    return run / "iterations" / f"k{k:02}" / f"j{j}" / "controller.py"


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.loop_gain")
    parser.add_argument("out", type=Path)
    levels = sorted(path.name for path in (RESULTS / "loops").iterdir())
    parser.add_argument("--levels", nargs="+", choices=levels, default=levels)
    parser.add_argument("-n", "--worlds", type=int, default=100)
    options = parser.parse_args()
    rows = []
    with WarmJudge() as judge:
        for level in options.levels:
            rows += gains(level, options.worlds, options.out, judge)
    write_atomic(options.out / "gain.csv", pd.DataFrame(rows).to_csv(index=False))
    write_atomic(options.out / "gain.md", table(rows))


if __name__ == "__main__":
    main()
