"""The metrics of a campaign as a table."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
from rich.markup import escape

from tdac_agent.cli.campaign_table import ALWAYS, SOMETIMES, make_table
from tdac_agent.cli.console import Console
from tdac_agent.cli.sentences import print_sentences
from tdac_agent.metrics import Rate
from tdac_agent.verification.verdict import COLOURS

WIDE = 110
"""Console width from which a rate and its interval share a line."""


def show_summary(summary: pd.DataFrame, console: Console) -> None:
    """Prints the metrics of each kind of run on single tasks."""
    if summary.empty:
        return
    shown = _show(summary, "task", console, _figures)
    legend = "95 % intervals; τ: mean iteration of success (docs/metrics.md)"
    if "tokens" in shown:
        legend += "\ntokens and USD: of all runs, per run that passed"
    console.print(f"[dim]{legend}[/]", soft_wrap=True)


def show_set_summary(summary: pd.DataFrame, console: Console) -> None:
    """Prints the metrics of each kind of run on task sets."""
    if summary.empty:
        return
    shown = _show(summary, "task set", console, _set_figures)
    legend = (
        "verified: on hidden worlds, each run with its own; time score: of the "
        "selected controllers on the worlds by which they were selected (optimistic); "
        "episodes: simulated on dev, per run; 95 % intervals over runs"
    )
    if "tokens" in shown:
        legend += "; tokens and USD: of all runs, per verified run"
    print_sentences(console, legend, "dim")


def _show(
    summary: pd.DataFrame,
    first: str,
    console: Console,
    figures_of: Callable[[dict[Any, Any], str], dict[str, str]],
) -> list[str]:
    """Prints a row per kind of run; returns the columns of figures."""
    names = [*ALWAYS]
    names += [n for n in SOMETIMES[1:] if summary[n].nunique() > 1]
    if (summary["optimizer"] != summary["learner"]).any():
        names.insert(2, "optimizer")
    between = " " if console.width >= WIDE else "\n"
    rows = summary.to_dict("records")
    figures = [figures_of(row, between) for row in rows]
    shown = [name for name in figures[0] if any(one[name] for one in figures)]
    heads = [first if name == "task" else name for name in names]
    table = make_table(heads, shown)
    for row, figure in zip(rows, figures, strict=True):
        labels = [Path(str(row[n])).name if n == "prompt" else row[n] for n in names]
        table.add_row(*(escape(str(n)) for n in labels), *(figure[n] for n in shown))
    console.print(table)
    return shown


def _done(row: dict[Any, Any], word: str, between: str) -> str:
    """How many of the runs passed, or are verified."""
    done, halted = row[word], int(row["censored"])
    text = f"[{COLOURS[word] if done else 'red'}]{done}[/]/{row['R']}"
    if halted:
        text += f"{between}[yellow]{halted} halted[/]"
    return text


def _set_figures(row: dict[Any, Any], between: str) -> dict[str, str]:
    return {
        "verified": _done(row, "verified", between),
        "rate": _rate(row, "rate", between),
        "time score": _rate(row, "time_score", between),
        "episodes": _number(row["episodes_mean"], ",.0f"),
        **_spent(row, "verified"),
    }


def _figures(row: dict[Any, Any], between: str) -> dict[str, str]:
    """The cells of a kind of run by column; empty where there is no value."""
    return {
        "passed": _done(row, "passed", between),
        "verified": f"[green]{row['verified']}[/]" if row["verified"] else "",
        "SR": _rate(row, "sr", between),
        "CS(K)": _rate(row, "cs_K", between),
        "first pass": _rate(row, "first_pass", between),
        "τ": _number(row["tau_mean"], ".1f"),
        **_spent(row, "passed"),
    }


def _spent(row: dict[Any, Any], word: str) -> dict[str, str]:
    tokens, cost = row[f"tokens_per_{word}"], row[f"cost_per_{word}"]
    cost = cost if tokens > 0 else math.nan
    return {
        "tokens": _number(tokens, ",.0f"),
        "USD": _number(cost, ".3f"),
    }


def _number(value: float, form: str) -> str:
    return "" if pd.isna(value) else format(value, form)


def _rate(row: dict[Any, Any], name: str, between: str) -> str:
    low, high = row[f"{name}_low"], row[f"{name}_high"]
    rate = str(Rate(row[name], 0, 0, low, high, ""))
    return escape(rate.replace(" ", between, 1))
