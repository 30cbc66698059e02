"""What a reviewer asked of the agreement table, after it was made; not planned.

    python -m benchmarks.agreement_review results/physics    # writes review.md

It needs the rows of `python -m benchmarks.agreement further`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd

from benchmarks.agreement_tables import (
    auc_text,
    grouped,
    load,
    read_episodes,
    share,
    sign_test,
)

FAST = "known", "unknown"
"""Levels with most of the failures."""


def review(out: Path) -> str:
    """The tables as Markdown."""
    pairs, rows = load(out)
    further = read_episodes(out / "further.csv")
    passing = pairs[pairs["here"].astype(bool)]
    every = pd.concat([rows, further])
    every = every[every["pair"].isin(passing["pair"])]
    return "\n".join(
        [
            "Asked for after the tables were made. Nothing here was planned, and "
            "nothing is corrected for the number of looks.",
            "",
            *_by_number(passing, every),
            "",
            *_groups(passing),
            "",
            f"AUC of the margin, on levels alone: "
            f"{auc_text(passing[passing['is_level'].astype(bool)], 'margin')}.",
            "",
        ]
    )


def _by_number(passing: pd.DataFrame, every: pd.DataFrame) -> list[str]:
    """Single episodes of all four numbers, where the pair passes here."""
    lines = [
        "| episodes of pairs that pass here | fail there | fail nudged |",
        "|---|---:|---:|",
    ]
    fast = set(passing.loc[passing["problem"].isin(FAST), "pair"])
    for words, chosen in (
        ("`known` and `unknown`", every["pair"].isin(fast)),
        ("all others", ~every["pair"].isin(fast)),
    ):
        for number in sorted(every["number"].unique()):
            own = every[chosen & (every["number"] == number)]
            cells = []
            for arm in ("there", "nudged"):
                driven = own[own["arm"] == arm]
                cells.append(f"{int((~driven['success']).sum())} of {len(driven)}")
            lines.append(f"| {words}, number {number} | {cells[0]} | {cells[1]} |")
    return lines


def _groups(passing: pd.DataFrame) -> list[str]:
    """Controllers by whether an episode came too close, and without fast levels."""
    close = passing["too_close"].astype(bool)
    fast = passing["problem"].isin(FAST)
    lines = [
        "| controllers that pass here | fail there | fail nudged | sign test |",
        "|---|---|---|---|",
    ]
    for words, own in (
        ("no episode too close", passing[~close]),
        ("some episode too close", passing[close]),
        ("without `known` and `unknown`", passing[~fast]),
    ):
        for by in ("controller", "family"):
            cells = []
            for arm in ("there", "nudged"):
                fails = grouped(own, by, arm)
                cells.append(share(int(fails.sum()), len(fails)))
            test = sign_test(own) if by == "controller" else ""
            name = words if by == "controller" else f"{words}, families"
            lines.append(f"| {name} | {cells[0]} | {cells[1]} | {test} |")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.agreement_review")
    parser.add_argument("out", type=Path)
    out = parser.parse_args().out
    text = review(out)
    (out / "review.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
