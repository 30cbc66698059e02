"""Statistics of entrants on the same worlds: paired, and stratified by set.

The unit is a world. Of an entrant that was trained with several seeds, or that drove
several times on each world, first the seeds or runs are resampled, then the worlds.
Sets weigh the same, whatever their number of worlds.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RESAMPLES = 9_999
LEAST_P = 2.0 / (RESAMPLES + 1)
"""The smallest p-value that this number of resamples can resolve."""
LEVEL = 0.95


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value with its interval, at the confidence `LEVEL`."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True, eq=False)
class Bootstrap:
    """Means of entrants, over all worlds and over resampled ones.

    Entrants that drove on the same worlds have the same resamples, so that differences
    of their means are paired.

    Attributes:
        mean: The mean.
        resampled: Shape (`RESAMPLES`,).
        worlds: Number of worlds.
    """

    mean: float
    resampled: Array
    worlds: int

    def estimate(self) -> Estimate:
        """The mean and its percentile interval."""
        tail = (1.0 - LEVEL) / 2.0
        low, high = np.quantile(self.resampled, (tail, 1.0 - tail)).tolist()
        return Estimate(self.mean, low, high)

    def minus(self, other: Bootstrap) -> Bootstrap:
        """The difference of two means."""
        resampled = self.resampled - other.resampled
        return Bootstrap(self.mean - other.mean, resampled, self.worlds)

    def p_value(self) -> float:
        """Two-sided p-value of the hypothesis that the mean is 0.

        It is at least the smallest one of an exact sign test on this number of worlds:
        a bootstrap of a few worlds would claim more than they can show.
        """
        below = int((self.resampled <= 0.0).sum())
        above = int((self.resampled >= 0.0).sum())
        p = 2.0 * (min(below, above) + 1) / (len(self.resampled) + 1)
        return min(1.0, max(p, 2.0 ** (1 - self.worlds)))


def bootstrap(scores: Mapping[str, Array], seed: int = 0) -> dict[str, Bootstrap]:
    """Means of entrants on the worlds of one set.

    Args:
        scores: By the entrant's name, shape (seeds or runs, worlds); all have the same
            worlds.
        seed: Seed of the resampling.
    """
    counts = {each.shape[1] for each in scores.values()}
    if len(counts) > 1:
        raise ValueError(f"expected scores on the same worlds, got {sorted(counts)}")
    if not counts:
        return {}
    rng, worlds = np.random.default_rng(seed), counts.pop()
    of_worlds = _weights(rng, worlds)
    results = {}
    for name, each in scores.items():
        # Independent of the other entrants: they share no seeds.
        chosen = _weights(rng, each.shape[0]) @ each
        means = (chosen * of_worlds).sum(axis=1)
        results[name] = Bootstrap(float(each.mean()), means, worlds)
    return results


@dataclass(frozen=True, slots=True)
class MeanChange:
    """Means before and after a change, and the interval of their difference.

    Attributes:
        before: Mean before it.
        after: Mean after it.
        low: Lower end of the difference, at the confidence `LEVEL`.
        high: Upper end of the difference.
        p: Two-sided p-value of the hypothesis that there is none; see
            `Bootstrap.p_value`.
    """

    before: float
    after: float
    low: float
    high: float
    p: float


def paired_change(before: Sequence[float], after: Sequence[float]) -> MeanChange:
    """Compares scores in the same worlds or episodes, in the same order."""
    scores = {"before": before, "after": after}
    results = bootstrap({name: np.array([each]) for name, each in scores.items()})
    one, other = results["before"], results["after"]
    change = other.minus(one)
    ends = change.estimate()
    return MeanChange(one.mean, other.mean, ends.low, ends.high, change.p_value())


def over_sets(parts: Sequence[Bootstrap]) -> Bootstrap:
    """The mean over sets of equal weight."""
    return Bootstrap(
        float(np.mean([each.mean for each in parts])),
        np.mean([each.resampled for each in parts], axis=0),
        sum(each.worlds for each in parts),
    )


def _weights(rng: np.random.Generator, count: int) -> Array:
    """Weights of `count` units in each resample, shape (`RESAMPLES`, count)."""
    draws = rng.integers(count, size=(RESAMPLES, count))
    flat = draws + count * np.arange(RESAMPLES)[:, None]
    counts = np.bincount(flat.ravel(), minlength=RESAMPLES * count)
    return counts.reshape(RESAMPLES, count) / count


def interquartile_mean(sets: Iterable[Array]) -> float:
    """Mean of the middle half of the scores of all sets together, of equal weight.

    Agarwal et al. (2021), "Deep RL at the edge of the statistical precipice".

    Args:
        sets: Scores of each set, of any shape.
    """
    parts = [np.ravel(each) for each in sets]
    values = np.concatenate(parts)
    weights = np.concatenate([np.full(len(p), 1.0 / len(p)) for p in parts])
    order = values.argsort(kind="stable")
    ends = weights[order].cumsum() / weights.sum()
    begins = np.concatenate([[0.0], ends[:-1]])
    kept = np.clip(np.minimum(ends, 0.75) - np.maximum(begins, 0.25), 0.0, None)
    return float(values[order] @ kept / kept.sum())


def probability_of_improvement(one: Array, other: Array) -> float:
    """Share of worlds on which one entrant scores more than another; a tie is half.

    Args:
        one: Shape (seeds, worlds).
        other: Shape (seeds, worlds), on the same worlds.
    """
    more = (one[:, None] > other[None]).mean()
    return float(more + (one[:, None] == other[None]).mean() / 2.0)


def holm(values: Sequence[float]) -> list[float]:
    """p-values adjusted for their number by Holm's step-down procedure (1979)."""
    order = np.argsort(values, kind="stable").tolist()
    adjusted, highest = [0.0] * len(values), 0.0
    for rank, k in enumerate(order):
        highest = max(highest, min(1.0, (len(values) - rank) * values[k]))
        adjusted[k] = highest
    return adjusted
