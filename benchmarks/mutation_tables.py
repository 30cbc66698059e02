"""Writes `results/mutation.csv` and `.md`: every mutant, and the totals."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any


def write_csv(path: Path, rows: Sequence[Any]) -> None:
    """Writes one line per mutant."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(asdict(rows[0])), lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def write_markdown(
    path: Path,
    kind: str,
    rows: Sequence[Any],
    controllers: Sequence[str],
    left_out: Mapping[str, str],
    seeds: int,
) -> None:
    """Writes the totals, a table by mutation, and the survivors by name."""
    harmful = [row for row in rows if row.harmful]
    survivors = [row for row in harmful if not row.killed]
    harmless = [row for row in rows if not row.harmful]
    alive = [row for row in harmless if not row.killed]
    killed = len(harmful) - len(survivors)
    lines = [
        f"# Mutation score: {kind}",
        "",
        f"Remade by `python -m benchmarks.mutation --kind {kind}`: {len(rows)} mutants "
        f"of {len(controllers)} good controllers; each row is in "
        f"`{path.with_suffix('.csv').name}`.",
        "",
        f"**{killed} of {len(harmful)} harmful mutants are killed** "
        f"({100 * killed / max(len(harmful), 1):.1f} %). Harmful: an independent judge "
        "finds that the mutant violates the contract or succeeds on less than 90 % of "
        f"{seeds} jittered starts, where the original succeeds on all of them.",
        f"Of the {len(harmless)} harmless ones, the suite passes {len(alive)}, as it "
        f"may, and kills {len(harmless) - len(alive)}.",
        "",
        f"Controllers: {', '.join(controllers)}.",
        *_excuse(left_out),
        "",
        "## Harmful mutants that survive",
        *(_names(survivors) or ["None."]),
        "",
        "## By mutation",
        "| mutation | mutants | harmful | harmful killed |",
        "|---|---:|---:|---:|",
        *_table(rows),
        "",
        "## Harmless mutants that survive",
        *_names(alive),
    ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _excuse(left_out: Mapping[str, str]) -> list[str]:
    if not left_out:
        return []
    names = "; ".join(f"{name} ({fault})" for name, fault in left_out.items())
    return [f"Not good on this task, and so left out: {names}."]


def _table(rows: Sequence[Any]) -> list[str]:
    count = Counter(row.mutation for row in rows)
    harmful = Counter(row.mutation for row in rows if row.harmful)
    killed = Counter(row.mutation for row in rows if row.harmful and row.killed)
    return [
        f"| {name} | {count[name]} | {harmful[name]} | {killed[name]} |"
        for name in sorted(count)
    ]


def _names(rows: Sequence[Any]) -> list[str]:
    names = []
    for row in rows:
        change = row.change.replace("`", "'")
        reason = f" — {row.reason}" if row.reason else ""
        names.append(
            f"- {row.mutation}: {row.controller}, line {row.line}: `{change}`{reason}"
        )
    return names
