"""Drives everything that `results/ladder/arena` shows, and draws its figures.

    python -m benchmarks.ladder_results drive OUT [--levels L...] [--kinds K...]
                                        [--split test] [-n 100] [--salt-file F]
    python -m benchmarks.ladder_results show RESULTS OUT
    python -m benchmarks.ladder_results hidden PUBLIC HIDDEN...

`drive` benches the entrants of each kind on each level, in OUT/KIND-LEVEL:

- `programs`: `builtin` and the classical planners,
- `answers`: the recorded first answers of `results/ladder/genuine`, as one entrant. Its
  files are resampled like the seeds of a training: no best answer is chosen,
- `learned`: the policies of `results/ladder/learned`, with all their seeds.

With `--split hidden` and no salt file, a salt is drawn for all of them, and revealed at
the end. After an interruption the same command goes on. `show` puts folders of such
folders together and writes `scores.svg`, the other figures, and `table.md`.

`hidden` prints how the results on hidden worlds agree with those on public ones: the
scores side by side, Kendall's tau of the order of the entrants on each level, and what
became of the differences that are significant on public worlds.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
from scipy import stats

from tdac_agent.bench.bench import WORLD_TABLE, bench
from tdac_agent.bench.figures import draw_figures, frame_of
from tdac_agent.bench.record import Bench, BenchRow, Interval
from tdac_agent.bench.shown import merged, reveal
from tdac_agent.planners.names import planner_names
from tdac_agent.planners.planner import levels_of
from tdac_agent.plots.arena import plot_scores
from tdac_agent.plots.style import save_dark
from tdac_agent.prompting.extract import extract_source
from tdac_agent.storage.files import write_atomic
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.salt import SEALED, drawn_salt
from tdac_envs.ladder.set_file import set_names

RESULTS = Path(__file__).parents[1] / "results" / "ladder"
KINDS = "programs", "answers", "learned"
ANSWERS = "first-answers"
LEARNED = "ppo", "ppo-with-map", "recurrent-ppo"
SIGNIFICANT = 0.05


def entrants(kind: str, level: str, out: Path) -> list[str]:
    """The words of `tdac bench` for the entrants of a kind."""
    if kind == "programs":
        rivals = [name for name in planner_names() if level in levels_of(name)]
        return ["builtin", *rivals]
    if kind == "answers":
        files = [str(file) for file in _answers(level, out / "answers" / level)]
        return [f"{ANSWERS}={','.join(files)}"] if files else []
    found = []
    for algo in LEARNED:
        folders = sorted((RESULTS / "learned").glob(f"{algo}-{level}-*"))
        files = [str(folder / "policy.zip") for folder in folders]
        found += [f"{algo}={','.join(files)}"] if files else []
    return found


def _answers(level: str, folder: Path) -> Iterator[Path]:
    """The files in the recorded first answers of a level."""
    for reply in sorted((RESULTS / "genuine" / level).glob("*/reply.md")):
        source = extract_source(reply.read_text(encoding="utf-8"))
        if source is not None:
            folder.mkdir(parents=True, exist_ok=True)
            file = folder / f"{reply.parent.name}.py"
            file.write_text(source, encoding="utf-8")
            yield file


def drive(options: argparse.Namespace) -> None:
    """Benches all kinds of entrants on all levels."""
    salt: Path | None = options.salt_file
    drawn = options.split == "hidden" and salt is None
    if drawn:
        options.out.mkdir(parents=True, exist_ok=True)
        salt = drawn_salt(options.out / SEALED, reuse=True)
    driven = []
    with WarmJudge() as judge:
        for level in options.levels or set_names():
            for kind in options.kinds or KINDS:
                words = entrants(kind, level, options.out)
                if not words:
                    continue
                found = bench(
                    words,
                    [level],
                    options.split,
                    options.n,
                    out=options.out / f"{kind}-{level}",
                    salt_file=salt,
                    judge=judge,
                )
                for row in found.rows:
                    score = row.time.value if row.time else row.problem
                    print(level, row.entrant, score, flush=True)
                driven.append(options.out / f"{kind}-{level}")
    for folder in driven if drawn else ():
        assert salt is not None
        reveal(folder, salt)


def show(options: argparse.Namespace) -> None:
    """Draws the figures of several folders together, and writes their table."""
    folders = _folders(options.results)
    found = merged(folders)
    options.out.mkdir(parents=True, exist_ok=True)
    table = pd.concat([pd.read_csv(folder / WORLD_TABLE) for folder in folders])
    rows = frame_of(found)
    maps = [
        name for name in set_names() if name != "epuck" and name in set(rows["set"])
    ]
    figure = plot_scores(rows, maps, told=True)
    draw_figures(found, table, options.out, scores=figure)
    save_dark(figure, options.out / "scores-dark.svg")
    write_atomic(options.out / "table.md", _table(found))


def hidden(options: argparse.Namespace) -> None:
    """Prints how results on hidden worlds agree with those on public ones."""
    public = merged(_folders(options.public))
    others = [merged(_folders(folder)) for folder in options.hidden]
    names = [folder.name for folder in options.hidden]
    print(_row("level", "ahead in public", *(f"in {name}" for name in names)))
    print(_row("---", *["---:"] * (1 + len(others))))
    for own in public.sets:
        ahead = len(_ahead(public, own.name))
        cells = [_agreement(public, other, own.name) for other in others]
        print(_row(f"`{own.name}`", ahead, *cells))
    print()
    counts = [f"{found.sets[0].worlds} worlds" for found in (public, *others)]
    heads = map(", ".join, zip(["public", *names], counts, strict=True))
    print(_row("level", "entrant", *heads))
    print(_row("---", "---", *["---:"] * len(counts)))
    for own in public.sets:
        scores = [_scores(found, own.name) for found in (public, *others)]
        for name in scores[0]:
            cells = [f"{each[name]:.3f}" if name in each else "" for each in scores]
            print(_row(f"`{own.name}`", name, *cells))


def _agreement(public: Bench, other: Bench, level: str) -> str:
    """What became of the differences that are significant on public worlds."""
    ahead, here = _ahead(public, level), _ahead(other, level)
    opposite = ahead & {(worse, better) for better, worse in here}
    one, two = _scores(public, level), _scores(other, level)
    both = sorted(one.keys() & two.keys())
    tau = stats.kendalltau([one[name] for name in both], [two[name] for name in both])
    found = f"{len(ahead & here)} again, {len(opposite)} opposite"
    return f"{found}, {len(here - ahead)} new; tau {tau.statistic:.2f}"


def _row(*cells: object) -> str:
    return f"| {' | '.join(map(str, cells))} |"


def _folders(results: Path) -> list[Path]:
    found = sorted(path.parent for path in results.glob("*/bench.json"))
    if not found:
        raise SystemExit(f"{results} has no folder with a bench.json")
    return found


def _scores(found: Bench, level: str) -> dict[str, float]:
    """The mean time score of each entrant that drove."""
    rows = [row for row in found.of_set(level) if row.kind != "privileged"]
    return {row.entrant: row.time.value for row in rows if row.time is not None}


def _ahead(found: Bench, level: str) -> set[tuple[str, str]]:
    """Pairs of which the first one is significantly ahead of the second one."""
    pairs = [
        pair for pair in found.pairs if pair.set == level and pair.p_holm < SIGNIFICANT
    ]
    return {
        (pair.one, pair.other) if pair.ahead.value > 0.0 else (pair.other, pair.one)
        for pair in pairs
    }


def _table(found: Bench) -> str:
    """Time score and success of each entrant on each set, in Markdown."""
    names = [each.name for each in found.sets]
    mean = frame_of(found).groupby("entrant")["time"].mean()
    lines = [
        f"| entrant | {' | '.join(f'`{name}`' for name in names)} |",
        f"|---|{'---|' * len(names)}",
    ]
    for entrant in mean.sort_values(ascending=False, kind="stable").index:
        rows = {row.set: row for row in found.rows if row.entrant == entrant}
        cells = [_cell(rows[name]) if name in rows else "" for name in names]
        lines.append(f"| {entrant} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _cell(row: BenchRow) -> str:
    if row.time is None or row.success is None:
        return row.problem or ""
    files = f"; {len(row.files)} files" if len(row.files) > 1 else ""
    return f"{_interval(row.time)}; {row.success.value:.0%}{files}"


def _interval(found: Interval) -> str:
    return f"{found.value:.3f} ({found.low:.3f} to {found.high:.3f})"


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ladder_results")
    commands = parser.add_subparsers(required=True)
    driving = commands.add_parser("drive")
    driving.add_argument("out", type=Path)
    driving.add_argument("--levels", nargs="*", choices=set_names())
    driving.add_argument("--kinds", nargs="*", choices=KINDS)
    driving.add_argument("--split", default="test")
    driving.add_argument("-n", type=int, default=100)
    driving.add_argument("--salt-file", type=Path)
    driving.set_defaults(run=drive)
    showing = commands.add_parser("show")
    showing.add_argument("results", type=Path)
    showing.add_argument("out", type=Path)
    showing.set_defaults(run=show)
    comparing = commands.add_parser("hidden")
    comparing.add_argument("public", type=Path)
    comparing.add_argument("hidden", type=Path, nargs="+")
    comparing.set_defaults(run=hidden)
    options = parser.parse_args()
    options.run(options)


if __name__ == "__main__":
    main()
