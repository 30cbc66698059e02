"""What may be spent: the worst case of a call is reserved before the call is made.

What is reserved and what is spent never exceeds the limits together, however many runs
share them: threads share a `Budget`, processes a file that each has a `Budget` of.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Literal

from tdac_agent.errors import RunError
from tdac_agent.storage.journal import append_record, read_on
from tdac_agent.storage.locks import wait_for

ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class Amount:
    """Tokens and money.

    Attributes:
        tokens: In and out together.
        usd: 0 for what is not counted in money.
    """

    tokens: int = 0
    usd: float = 0.0

    def __post_init__(self) -> None:
        if self.tokens < 0 or not 0 <= self.usd < math.inf:
            raise ValueError(f"expected an amount of 0 or more, got {self}")

    def plus(self, other: Amount) -> Amount:
        """Both together."""
        return Amount(self.tokens + other.tokens, self.usd + other.usd)

    def times(self, count: int) -> Amount:
        """So many of it."""
        return Amount(count * self.tokens, count * self.usd)


NOTHING = Amount()
Limit = Literal["--max-cost", "--max-tokens"]


class BudgetExhausted(Exception):
    """The worst case of a call is more than what is left.

    Args:
        message: One line.
        limit: What it would go beyond.
        taken: All that is reserved or spent without the call.
    """

    def __init__(self, message: str, limit: Limit, taken: Amount) -> None:
        super().__init__(message)
        self._limit = limit
        self._taken = taken

    def flag(self, most: Amount, times: int = 1) -> str:
        """The flag with which more could be taken, cents rounded up.

        Args:
            most: What more.
            times: So many times all that has been taken then.
        """
        total = self._taken.plus(most).times(times)
        if self._limit == "--max-tokens":
            return f"{self._limit} {total.tokens}"
        return f"{self._limit} {math.ceil(100 * total.usd - ROUNDING) / 100:.12g}"


@dataclass(slots=True)
class _Taken:
    """What calls have taken, by the last word on each of them, and the sum of it.

    The sum is exact, and need not be made anew with each call.
    """

    of: dict[str, Amount] = field(default_factory=dict)
    _tokens: int = 0
    _usd: Fraction = field(default_factory=Fraction)

    @property
    def all(self) -> Amount:
        return Amount(self._tokens, float(self._usd))

    def but(self, call: str) -> Amount:
        """All without a call."""
        one = self.of.get(call, NOTHING)
        usd = self._usd - Fraction(one.usd)
        return Amount(self._tokens - one.tokens, float(usd))

    def put(self, call: str, amount: Amount) -> None:
        before = self.of.get(call, NOTHING)
        self._tokens += amount.tokens - before.tokens
        self._usd += Fraction(amount.usd) - Fraction(before.usd)
        self.of[call] = amount


class Budget:
    """Limits, and what has been taken of them. For any number of threads.

    Args:
        max_cost: USD, None for no limit.
        max_tokens: In and out together, None for no limit.
        ledger: File that processes share; made where it is not there.
    """

    def __init__(
        self,
        max_cost: float | None = None,
        max_tokens: int | None = None,
        ledger: Path | None = None,
    ) -> None:
        self.max_cost = max_cost
        self.max_tokens = max_tokens
        self._ledger = ledger
        self._lock = threading.Lock()
        self._taken = _Taken()
        self._read_to = 0

    @property
    def taken(self) -> Amount:
        """What is reserved or spent."""
        with self._open():
            return self._taken.all

    def reserve(self, call: str, worst: Amount) -> None:
        """Takes the most that a call can cost.

        Args:
            call: Its name, the same for the same call in another process.
            worst: The most.

        Raises:
            BudgetExhausted: There is less left; nothing was taken.
        """
        with self._open():
            self._check(self._taken.but(call), worst)
            self._take(call, worst)

    def settle(self, call: str, spent: Amount) -> None:
        """Replaces what was reserved for a call by what it took."""
        with self._open():
            self._take(call, spent)

    def restore(self, calls: Mapping[str, Amount]) -> None:
        """Takes over calls of an earlier process, also beyond the limits."""
        with self._open():
            for call, amount in calls.items():
                if self._taken.of.get(call) != amount:
                    self._take(call, amount)

    def _check(self, taken: Amount, worst: Amount) -> None:
        """Refuses what is more than what is left.

        Raises:
            BudgetExhausted: It says how much there was.
        """
        both, cost, tokens = taken.plus(worst), self.max_cost, self.max_tokens
        if cost is not None and worst.usd and both.usd > cost + ROUNDING:
            raise BudgetExhausted(
                f"{told_usd(taken.usd)} of {told_usd(cost)} are spent or reserved, and "
                f"the next question may cost {told_usd(worst.usd)}",
                "--max-cost",
                taken,
            )
        if tokens is not None and worst.tokens and both.tokens > tokens:
            raise BudgetExhausted(
                f"{taken.tokens} of {tokens} tokens are spent or reserved, and the "
                f"next question may take {worst.tokens}",
                "--max-tokens",
                taken,
            )

    def _take(self, call: str, amount: Amount) -> None:
        if self._ledger is not None:
            record = {"call": call, "tokens": amount.tokens, "usd": amount.usd}
            append_record(self._ledger, record)
            self._read_to = self._ledger.stat().st_size
        self._taken.put(call, amount)

    @contextmanager
    def _open(self) -> Generator[None]:
        """What is taken, up to date, and not to be changed by others meanwhile."""
        with self._lock:
            if self._ledger is None:
                yield
                return
            with wait_for(self._ledger):
                self._catch_up(self._ledger)
                yield

    def _catch_up(self, ledger: Path) -> None:
        """Takes in what was written since; all of it, if that is another file now."""
        if ledger.stat().st_size < self._read_to:
            self._taken, self._read_to = _Taken(), 0
        calls, read_to = _read(ledger, self._read_to)
        for call, amount in calls:
            self._taken.put(call, amount)
        self._read_to = read_to


def told_usd(amount: float) -> str:
    """An amount of money for people: two digits that matter at least."""
    return f"{amount:.2f} USD" if amount >= 0.1 or amount == 0 else f"{amount:.4f} USD"


def _read(ledger: Path, offset: int) -> tuple[list[tuple[str, Amount]], int]:
    """What a file says of calls behind an offset, and the offset behind that.

    Raises:
        RunError: It is no such file.
    """
    try:
        records, end = read_on(ledger, offset)
        calls = [(one["call"], Amount(one["tokens"], one["usd"])) for one in records]
    except (KeyError, TypeError, ValueError) as error:
        raise RunError(f"{ledger} is no record of a budget: {error}") from error
    return calls, end
