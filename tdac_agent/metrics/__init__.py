"""Metrics of synthesis runs as the paper defines them, with confidence intervals.

Runs are given as pandas frames: one row per run (`RUN_COLUMNS`) and one per candidate
(`CANDIDATE_COLUMNS`). `ASSUMPTIONS` states what each kind of interval assumes.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tdac_agent.metrics.compare import (
        Comparison,
        best_of_n,
        compare_paired,
        pass_at_n,
    )
    from tdac_agent.metrics.cumulative import cumulative_success
    from tdac_agent.metrics.exact import exact_interval
    from tdac_agent.metrics.frames import (
        CANDIDATE_COLUMNS,
        RUN_COLUMNS,
        RunFrames,
        find_runs,
        frames_from_tau,
        frames_of,
        iterations_of,
        join_frames,
        load_frames,
    )
    from tdac_agent.metrics.rates import (
        ASSUMPTIONS,
        Rate,
        candidate_rate,
        first_pass,
        rate_of_runs,
        success_rate,
        unbiased_success_rate,
    )
    from tdac_agent.metrics.reported import load_reported
    from tdac_agent.metrics.set_runs import (
        SET_RUN_COLUMNS,
        set_frame_of,
        summarise_sets,
    )
    from tdac_agent.metrics.table import summarise

__all__ = [
    "ASSUMPTIONS",
    "CANDIDATE_COLUMNS",
    "RUN_COLUMNS",
    "SET_RUN_COLUMNS",
    "Comparison",
    "Rate",
    "RunFrames",
    "best_of_n",
    "candidate_rate",
    "compare_paired",
    "cumulative_success",
    "exact_interval",
    "find_runs",
    "first_pass",
    "frames_from_tau",
    "frames_of",
    "iterations_of",
    "join_frames",
    "load_frames",
    "load_reported",
    "pass_at_n",
    "rate_of_runs",
    "set_frame_of",
    "success_rate",
    "summarise",
    "summarise_sets",
    "unbiased_success_rate",
]

_HOME = {
    "ASSUMPTIONS": "rates",
    "CANDIDATE_COLUMNS": "frames",
    "Comparison": "compare",
    "RunFrames": "frames",
    "RUN_COLUMNS": "frames",
    "Rate": "rates",
    "SET_RUN_COLUMNS": "set_runs",
    "best_of_n": "compare",
    "candidate_rate": "rates",
    "compare_paired": "compare",
    "cumulative_success": "cumulative",
    "exact_interval": "exact",
    "find_runs": "frames",
    "first_pass": "rates",
    "frames_from_tau": "frames",
    "frames_of": "frames",
    "iterations_of": "frames",
    "join_frames": "frames",
    "load_frames": "frames",
    "load_reported": "reported",
    "pass_at_n": "compare",
    "rate_of_runs": "rates",
    "set_frame_of": "set_runs",
    "success_rate": "rates",
    "summarise": "table",
    "summarise_sets": "set_runs",
    "unbiased_success_rate": "rates",
}


def __getattr__(name: str) -> Any:
    """Imports a submodule on first use, because most of them load pandas."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    """All public names, imported yet or not."""
    return sorted({*globals(), *__all__})
