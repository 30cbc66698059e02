"""Statistics of a bench: rows, figures over all sets, and pairs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from statistics import fmean
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tdac_agent.bench.record import BenchOverall, BenchPair, Interval
from tdac_agent.metrics.exact import exact_interval, sign_test
from tdac_agent.metrics.paired import (
    Bootstrap,
    bootstrap,
    holm,
    interquartile_mean,
    over_sets,
    probability_of_improvement,
)
from tdac_agent.verification.episode_report import cause_of
from tdac_agent.verification.judge.episode_row import EpisodeRow

Array = NDArray[np.float64]
Rows = Sequence[Sequence[EpisodeRow]]


@dataclass(frozen=True, slots=True, eq=False)
class Driven:
    """What an entrant reached on the worlds of a set.

    Attributes:
        entrant: Its name.
        time: Time scores, shape (files x runs, worlds).
        success: Whether the goal was reached, 0 or 1, of the same shape.
    """

    entrant: str
    time: Array
    success: Array

    @classmethod
    def of(cls, entrant: str, episodes: Rows, runs: int = 1) -> Driven:
        """What it reached in episodes.

        Args:
            entrant: Its name.
            episodes: For each file, in the order of runs, then of worlds.
            runs: How often each file drove on each world.
        """
        time = [[each.time_score for each in part] for part in episodes]
        success = [[each.success for each in part] for part in episodes]
        shape = len(episodes) * runs, -1
        return cls(
            entrant,
            np.array(time, np.float64).reshape(shape),
            np.array(success, np.float64).reshape(shape),
        )


def figures_of(driven: Driven, parts: Rows) -> dict[str, Any]:
    """The figures of `BenchRow`.

    Args:
        driven: What the entrant reached.
        parts: The episodes in which it did.
    """
    episodes = [each for part in parts for each in part]
    outcomes = Counter(each.outcome for each in episodes)
    reached = sum(each.success for each in episodes)
    if len(driven.success) == 1:
        low, high = exact_interval(reached, len(episodes))
        share = Interval(value=reached / len(episodes), low=low, high=high)
    else:
        share = _interval(bootstrap({"": driven.success})[""])
    failures = [each for each in episodes if not each.success]
    late, hit = outcomes["out of time"], outcomes["collision"]
    return {
        "worlds": driven.time.shape[1],
        "success": share,
        "time": _time_of(driven, share),
        "causes": dict(Counter(map(cause_of, failures)).most_common()),
        "path": fmean(each.path_score for each in episodes),
        "barn": fmean(each.barn_score for each in episodes),
        "contacts": dict(Counter(each.contact for each in episodes if each.contact)),
        "late": late,
        "errors": len(failures) - late - hit,
    }


def _time_of(driven: Driven, success: Interval) -> Interval:
    """The mean time score, which is at most the rate of success."""
    found = _interval(bootstrap({"": driven.time})[""])
    return found if driven.success.any() else _up_to(found, success.high)


def _up_to(found: Interval, high: float) -> Interval:
    """The interval of an entrant without a success.

    Resamples of zeros would claim to know it exactly.
    """
    return found.model_copy(update={"high": high})


def overall_of(sets: Mapping[str, Sequence[Driven]]) -> tuple[BenchOverall, ...]:
    """Figures of the entrants that drove on all sets, the best first.

    Args:
        sets: What was driven, by the name of the set.
    """
    means, names = _means(sets), _on_all(sets)
    found = []
    for name in names:
        own = [
            each for driven in sets.values() for each in driven if each.entrant == name
        ]
        time = _interval(over_sets([means[each][name] for each in sets]))
        if not any(each.success.any() for each in own):
            highs = [exact_interval(0, each.success.size)[1] for each in own]
            time = _up_to(time, fmean(highs))
        found.append(
            BenchOverall(
                entrant=name,
                time=time,
                middle=interquartile_mean(each.time for each in own),
                success=fmean(float(each.success.mean()) for each in own),
            )
        )
    return tuple(sorted(found, key=lambda each: -each.time.value))


def pairs_of(sets: Mapping[str, Sequence[Driven]]) -> tuple[BenchPair, ...]:
    """All pairs of entrants on each set and, if there are several, over all sets.

    p-values are adjusted within each set, and within the pairs over all sets.

    Args:
        sets: What was driven, by the name of the set.
    """
    means, found = _means(sets), []
    for name, driven in sets.items():
        found += _adjusted(
            [_pair(name, means[name], *pair) for pair in combinations(driven, 2)]
        )
    if len(sets) > 1:
        whole = {
            name: over_sets([means[each][name] for each in sets])
            for name in _on_all(sets)
        }
        found += _adjusted(
            [_ahead(None, whole, one, other) for one, other in combinations(whole, 2)]
        )
    return tuple(found)


def _means(sets: Mapping[str, Sequence[Driven]]) -> dict[str, dict[str, Bootstrap]]:
    """Mean time scores by set and entrant; sets are resampled independently."""
    return {
        name: bootstrap({each.entrant: each.time for each in driven}, seed)
        for seed, (name, driven) in enumerate(sets.items())
    }


def _on_all(sets: Mapping[str, Sequence[Driven]]) -> list[str]:
    """The entrants that drove on all sets, in the order of the first one."""
    parts = [[each.entrant for each in driven] for driven in sets.values()]
    return [name for name in parts[0] if all(name in part for part in parts)]


def _pair(
    name: str, means: Mapping[str, Bootstrap], one: Driven, other: Driven
) -> BenchPair:
    pair = _ahead(name, means, one.entrant, other.entrant)
    more = {"better": probability_of_improvement(one.time, other.time)}
    if len(one.time) == len(other.time) == 1:
        ours, theirs = one.success[0], other.success[0]
        first = int(((ours == 1) & (theirs == 0)).sum())
        second = int(((ours == 0) & (theirs == 1)).sum())
        more |= {"only_one": first, "only_other": second}
        more |= {"p_success": sign_test(first, second)}
    return pair.model_copy(update=more)


def _ahead(
    name: str | None, means: Mapping[str, Bootstrap], one: str, other: str
) -> BenchPair:
    difference = means[one].minus(means[other])
    p = difference.p_value()
    return BenchPair(
        set=name, one=one, other=other, ahead=_interval(difference), p=p, p_holm=p
    )


def _adjusted(pairs: Sequence[BenchPair]) -> list[BenchPair]:
    adjusted = holm([pair.p for pair in pairs])
    return [
        pair.model_copy(update={"p_holm": p})
        for pair, p in zip(pairs, adjusted, strict=True)
    ]


def _interval(found: Bootstrap) -> Interval:
    return Interval.of(found.estimate())
