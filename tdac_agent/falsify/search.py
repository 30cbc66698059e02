"""Searches for the smallest deviation with which a policy fails.

First each part alone, in both directions, by bisection; then all of them together, by
CMA-ES on the margin (Hansen 2016, package `cma`); then the smallest failure is shrunk:
parts are left out one at a time, and the others made smaller. All draws follow from one
seed.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tdac_agent.falsify.drives import Drives
from tdac_agent.runs.falsification import Counterexample, Direction, Envelope
from tdac_agent.tasks.deviation import DEVIATIONS, MOST, Deviation, limit_of
from tdac_agent.verification.judge.episode_row import EpisodeRow
from tdac_agent.verification.judge.worlds import Case

POPULATION = 12
"""Cases of a generation of CMA-ES."""
CLOSE = 0.05
"""Bisections end when the bracket is this share of its upper end."""
FOR_SINGLES, FOR_SHRINKING = 0.5, 0.25
"""Shares of the budget."""
SURVIVED = 1000.0
"""What a survived case costs at least: more than any failed one."""
_ROUNDED, _SLACK = 1.001, 1e-9
NEAR = 0.25
"""First step of the search around an expected failure, in sizes."""
_FAR = 5.0
"""Gap beyond which a case is not nearer to a failure, body radii."""


@dataclass(slots=True)
class Search:
    """The search in one world.

    Attributes:
        drives: Drives the cases.
        number: Seed of the task, or number of the world.
        space: Parts that are searched, with their sizes.
        steps: Parts that have multiples of a value alone, with this value.
        seed: Seed of the search.
        budget: Most episodes of this world.
    """

    drives: Drives
    number: int
    space: Mapping[str, float]
    steps: Mapping[str, float]
    seed: int
    budget: int
    _best: tuple[float, Deviation, EpisodeRow, str] | None = None
    _begun: int = field(init=False)

    def __post_init__(self) -> None:
        self._begun = self.drives.count

    @property
    def spent(self) -> int:
        """Episodes of this world so far."""
        return self.drives.count - self._begun

    def run(self) -> Envelope:
        """The envelope of this world."""
        (base,) = self._rows([Deviation()])
        assert base is not None
        about = {"number": self.number, "base": base}
        if not base.success:
            found = Counterexample(
                number=self.number,
                deviation=Deviation(),
                norm=0.0,
                found_by="none",
                row=base,
            )
            return Envelope(**about, counterexample=found, episodes=self.spent)
        directions = self._singles(round(FOR_SINGLES * self.budget))
        most = self.budget - round(FOR_SHRINKING * self.budget)
        self._together(most, base, nearest_of(directions, self.space))
        self._shrink()
        return Envelope(
            **about,
            directions=tuple(map(self._narrowed, directions)),
            counterexample=self._found(),
            episodes=self.spent,
        )

    def _narrowed(self, own: Direction) -> Direction:
        """A direction, with the smallest failure if that is of this part alone."""
        parts = {} if self._best is None else self._best[1].parts()
        value = parts.get(own.part, 0.0)
        same = list(parts) == [own.part] and value * own.sign > 0.0
        if not same or (own.fails is not None and abs(own.fails) <= abs(value)):
            return own
        survives = own.survives if abs(own.survives) < abs(value) else 0.0
        assert self._best is not None
        update = {"fails": value, "survives": survives, "cause": self._best[2].cause}
        return own.model_copy(update=update)

    def _found(self) -> Counterexample | None:
        if self._best is None:
            return None
        norm, deviation, row, by = self._best
        return Counterexample(
            number=self.number,
            deviation=deviation,
            norm=round(norm, 6),
            found_by=by,
            row=row,
        )

    def _rows(self, deviations: Sequence[Deviation]) -> list[EpisodeRow | None]:
        """Rows of possible deviations; None for impossible ones, or without budget."""
        possible = [self.drives.is_possible(each) for each in deviations]
        cases = [
            Case(number=self.number, deviation=each)
            for each, fits in zip(deviations, possible, strict=True)
            if fits
        ]
        rest = max(0, self.budget - self.spent)
        rows = iter(self.drives.drive(cases[:rest]) + [None] * len(cases[rest:]))
        return [next(rows) if fits else None for fits in possible]

    def _note(self, deviation: Deviation, row: EpisodeRow | None, by: str) -> bool:
        """Keeps a smaller failure; returns whether it is one."""
        if row is None or row.success:
            return False
        norm = deviation.norm(self.space)
        if self._best is None or norm < self._best[0]:
            self._best = norm, deviation, row, by
        return True

    # Each part alone.

    def _singles(self, budget: int) -> list[Direction]:
        """What is survived of each part alone, in each direction."""
        brackets = [
            _Bracket(name, sign, size, limit_of(name, size), self.steps.get(name, 0.0))
            for name, size in self.space.items()
            for sign in ((1, -1) if DEVIATIONS[name].signed else (1,))
        ]
        while self.spent < budget:
            asked = [each for each in brackets if each.next() is not None]
            # If few episodes are left, they narrow what fails.
            asked.sort(key=lambda each: each.fails is None)
            asked = asked[: budget - self.spent]
            if not asked:
                break
            deviations = [each.deviation(each.next() or 0.0) for each in asked]
            rows = self._rows(deviations)
            for each, deviation, row in zip(asked, deviations, rows, strict=True):
                fits = self.drives.is_possible(deviation)
                each.learn(row, fits=fits)
                self._note(deviation, row, "single")
        return [each.direction() for each in brackets]

    # All parts together.

    def _together(
        self, budget: int, base: EpisodeRow, nearest: dict[str, float]
    ) -> None:
        """CMA-ES in units of the sizes, until the budget is spent.

        It begins where the single parts let the nearest failure be expected.
        """
        names = list(self.space)
        if len(names) < 2:
            return
        import cma  # slow to import

        far = [limit_of(name, size) / size for name, size in self.space.items()]
        low = [
            -most if DEVIATIONS[name].signed else 0.0
            for name, most in zip(names, far, strict=True)
        ]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            evolution = cma.CMAEvolutionStrategy(
                [nearest.get(name, 0.0) for name in names],
                NEAR if nearest else 0.5 * MOST / math.sqrt(len(names)) + NEAR,
                {
                    # 0 would draw a seed from the clock.
                    "seed": 1 + self.seed % (1 << 30),
                    "popsize": POPULATION,
                    "bounds": [low, far],
                    "verbose": -9,
                },
            )
            while self.spent + POPULATION <= budget and not evolution.stop():
                points = evolution.ask()
                deviations = [self._deviation(names, point) for point in points]
                rows = self._rows(deviations)
                costs = []
                for deviation, row in zip(deviations, rows, strict=True):
                    self._note(deviation, row, "search")
                    costs.append(self._cost(deviation, row, base))
                evolution.tell(points, costs)

    def _deviation(self, names: list[str], point: NDArray[np.float64]) -> Deviation:
        """The deviation at a point, with values that there are."""
        sizes = self.space.values()
        parts = zip(names, sizes, point, strict=True)
        return Deviation.of(
            {n: near(size * float(z), self.steps.get(n, 0.0)) for n, size, z in parts}
        )

    def _cost(
        self, deviation: Deviation, row: EpisodeRow | None, base: EpisodeRow
    ) -> float:
        """A failure costs its length, anything else more: the more, the safer it is."""
        norm = deviation.norm(self.space)
        if row is None:
            return 2.0 * SURVIVED + norm
        if not row.success:
            return norm
        gap = row.smallest_gap.radii if row.smallest_gap is not None else _FAR
        slower = row.steps / max(1, base.steps) - 1.0
        return SURVIVED + min(gap, _FAR) - 0.5 * min(max(slower, 0.0), 1.0)

    # The smallest failure, with fewer and smaller parts.

    def _shrink(self) -> None:
        """Leaves out parts one at a time, then makes the others smaller."""
        if self._best is None:
            return
        by = self._best[3]
        self._drop_smallest(by)
        while len(self._best[1].parts()) > 1 and self.spent < self.budget:
            own = self._best[1]
            # Of those that still fail without a part, the one that gets shortest.
            fewer = [own.without(name) for name in own.parts()]
            rows = self._rows(fewer)
            failed = [self._note(d, r, by) for d, r in zip(fewer, rows, strict=True)]
            if not any(failed):
                break
        for name in list(self._best[1].parts()):
            self._smaller(name, by)

    def _drop_smallest(self, by: str) -> None:
        """Leaves out as many of the smallest parts as it can, found by bisection.

        The others are made larger, so that the length stays: fewer parts rather than
        smaller ones.
        """
        assert self._best is not None
        whole = self._best[1]
        size = {name: abs(v) / self.space[name] for name, v in whole.parts().items()}
        order = sorted(size, key=lambda name: size[name])
        most, least = len(order), 0  # dropping `least` fails, dropping `most` does not
        while most - least > 1 and self.spent < self.budget:
            count = (most + least) // 2
            kept = {name: whole.parts()[name] for name in order[count:]}
            grown = Deviation.of(kept).norm(self.space)
            factor = whole.norm(self.space) / grown
            deviation = Deviation.of(
                {n: near(factor * v, self.steps.get(n, 0.0)) for n, v in kept.items()}
            )
            norm = deviation.norm(self.space)
            row = None
            if norm <= _ROUNDED * whole.norm(self.space) and self._is_within(deviation):
                (row,) = self._rows([deviation])
            if row is None or row.success:
                most = count
            else:
                least = count
                self._best = norm, deviation, row, by

    def _is_within(self, deviation: Deviation) -> bool:
        """Whether each part is within the limit of the search."""
        return all(
            abs(value) <= limit_of(name, self.space[name]) + _SLACK
            for name, value in deviation.parts().items()
        )

    def _smaller(self, name: str, by: str) -> None:
        """Bisects one part of the smallest failure, with the others as they are."""
        assert self._best is not None
        own = self._best[1].parts()
        safe, fails = 0.0, own[name]
        step = self.steps.get(name, 0.0)
        while self.spent < self.budget:
            middle = between(safe, fails, step)
            if middle is None:
                break
            deviation = Deviation.of({**own, name: middle})
            (row,) = self._rows([deviation])
            if self._note(deviation, row, by):
                fails = middle
            else:
                safe = middle


def nearest_of(
    directions: Sequence[Direction], space: Mapping[str, float]
) -> dict[str, float]:
    """Where the nearest failure is, if margins shrink evenly in each part, in sizes.

    With failures at t_i alone, it is on the plane of sum z_i / t_i = 1: the point of
    it that is nearest to 0, as in the first-order reliability method.
    """
    ends: dict[str, float] = {}
    for each in directions:
        if each.fails is None:
            continue
        end = each.fails / space[each.part]
        if abs(end) < abs(ends.get(each.part, math.inf)):
            ends[each.part] = end
    whole = sum(end**-2 for end in ends.values())
    return {name: 1.0 / (end * whole) for name, end in ends.items()}


def near(value: float, step: float) -> float:
    """The nearest value that there is; few digits, so that it can be written."""
    return float(f"{step * round(value / step) if step else value:.6g}")


def between(safe: float, fails: float, step: float) -> float | None:
    """The value in the middle of a bracket; None if it is narrow enough.

    Args:
        safe: A value that is survived.
        fails: One of the same sign that is not, further from 0.
        step: Values are its multiples; 0 for any.
    """
    if abs(fails - safe) <= max(1.5 * step, CLOSE * abs(fails)):
        return None
    middle = near(0.5 * (safe + fails), step)
    return None if middle in (safe, fails) else middle


@dataclass(slots=True)
class _Bracket:
    """What is known of one part in one direction: absolute values.

    The size, twice and three times the size are tried first, then the bracket is
    halved.
    """

    name: str
    sign: int
    size: float
    limit: float
    step: float
    safe: float = 0.0
    fails: float | None = None
    impossible: bool = False
    cause: str | None = None
    _over: bool = False

    def deviation(self, value: float) -> Deviation:
        """The deviation with this absolute value."""
        return Deviation.of({self.name: self.sign * value})

    def next(self) -> float | None:
        """The next value to try; None if nothing is left to learn."""
        if self._over:
            return None
        if self.fails is not None:
            return between(self.safe, self.fails, self.step)
        value = near(self.safe + max(self.size, self.step), self.step)
        return None if value > self.limit + 1e-9 else value

    def learn(self, row: EpisodeRow | None, *, fits: bool) -> None:
        """Takes over what happened at the next value."""
        value = self.next()
        assert value is not None
        if not fits:
            self.impossible, self._over = True, True
        elif row is None:  # no budget
            self._over = True
        elif row.success:
            self.safe = value
        else:
            self.fails, self.cause = value, row.cause

    def direction(self) -> Direction:
        """What is kept of it, with its sign."""
        fails = None if self.fails is None else round(self.sign * self.fails, 6)
        return Direction(
            part=self.name,
            sign=self.sign,
            survives=round(self.sign * self.safe, 6),
            fails=fails,
            limit=round(self.sign * self.limit, 6),
            impossible=self.impossible,
            cause=self.cause,
        )
