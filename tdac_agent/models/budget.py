"""Spending limits: the worst case of a call is reserved before the call is made.

Reservations and spending together never exceed the limits, however many runs share
them. Threads share one `Budget`; processes share a ledger file, each with a `Budget`.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from tdac_agent.errors import RunError
from tdac_agent.storage.journal import append_record, read_records_from
from tdac_agent.storage.locks import wait_for
from tdac_envs.core.strict_model import StrictModel

ROUNDING = 1e-9
MOST_USD, MOST_TOKENS = 1e6, 10**12
"""Largest limits that are suggested."""


@dataclass(frozen=True, slots=True)
class Amount:
    """Tokens and money.

    Attributes:
        tokens: Input and output tokens together.
        usd: Cost in USD; 0 if it is not counted in money.
    """

    tokens: int = 0
    usd: float = 0.0

    def __post_init__(self) -> None:
        if self.tokens < 0 or not 0 <= self.usd < math.inf:
            raise ValueError(f"expected an amount of 0 or more, got {self}")

    def plus(self, other: Amount) -> Amount:
        """Returns the sum."""
        return Amount(self.tokens + other.tokens, self.usd + other.usd)

    def times(self, count: int) -> Amount:
        """Returns this amount multiplied by `count`."""
        return Amount(count * self.tokens, count * self.usd)


NOTHING = Amount()
Limit = Literal["--max-cost", "--max-tokens"]


class Enough(StrictModel):
    """A limit with which a run can go on after its budget has ended it."""

    max_cost: float | None = Field(None, gt=0, le=MOST_USD, description="USD.")
    max_tokens: int | None = Field(None, gt=0, le=MOST_TOKENS)

    @model_validator(mode="before")
    @classmethod
    def _read(cls, value: Any) -> Any:
        """Records were once written with the flag as a text."""
        if isinstance(value, str):
            flag, _, number = value.partition(" ")
            return {flag.removeprefix("--").replace("-", "_"): number}
        return value

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.max_cost is None) == (self.max_tokens is None):
            raise ValueError("expected either max_cost or max_tokens")
        return self

    @property
    def amount(self) -> float:
        """The limit, in its unit."""
        return self.max_cost or self.max_tokens or 0.0

    @property
    def words(self) -> tuple[str, str]:
        """The flag and its value, as words of a command line."""
        if self.max_cost is not None:
            return "--max-cost", f"{self.max_cost:.12g}"
        return "--max-tokens", str(self.max_tokens)

    def __str__(self) -> str:
        return " ".join(self.words)


class BudgetExhausted(Exception):
    """The worst case of a call exceeds what is left.

    Args:
        message: One line.
        limit: Flag of the limit that it would exceed.
        taken: Amount reserved or spent without the call.
    """

    def __init__(self, message: str, limit: Limit, taken: Amount) -> None:
        super().__init__(message)
        self._limit = limit
        self._taken = taken

    def enough(self, most: Amount, times: int = 1) -> Enough:
        """Returns a sufficient limit, rounded up to whole cents.

        Args:
            most: Amount needed in addition to what is taken.
            times: Factor applied to the sum.
        """
        total = self._taken.plus(most).times(times)
        if self._limit == "--max-tokens":
            return Enough(max_tokens=min(max(total.tokens, 1), MOST_TOKENS))
        cents = max(math.ceil(100 * total.usd - ROUNDING), 1)
        return Enough(max_cost=min(cents / 100, MOST_USD))


@dataclass(slots=True)
class _Taken:
    """The latest amount of each call, and the exact running sum of them."""

    by_call: dict[str, Amount] = field(default_factory=dict)
    _tokens: int = 0
    _usd: Fraction = field(default_factory=Fraction)

    @property
    def total(self) -> Amount:
        return Amount(self._tokens, float(self._usd))

    def without(self, call: str) -> Amount:
        """Returns the sum without one call."""
        one = self.by_call.get(call, NOTHING)
        usd = self._usd - Fraction(one.usd)
        return Amount(self._tokens - one.tokens, float(usd))

    def put(self, call: str, amount: Amount) -> None:
        before = self.by_call.get(call, NOTHING)
        self._tokens += amount.tokens - before.tokens
        self._usd += Fraction(amount.usd) - Fraction(before.usd)
        self.by_call[call] = amount


class Budget:
    """Limits and the amounts taken from them; safe for any number of threads.

    Args:
        max_cost: USD, None for no limit.
        max_tokens: Input and output tokens together, None for no limit.
        ledger: File that processes share; created if it is missing.
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
        """The amount that is reserved or spent."""
        with self._synchronized():
            return self._taken.total

    def reserve(self, call: str, worst: Amount) -> None:
        """Reserves the worst-case amount of a call.

        Args:
            call: Name of the call, the same in every process.
            worst: Worst-case amount.

        Raises:
            BudgetExhausted: Less than that is left; nothing was reserved.
        """
        with self._synchronized():
            self._check(self._taken.without(call), worst)
            self._take(call, worst)

    def settle(self, call: str, spent: Amount) -> None:
        """Replaces the reservation of a call with the amount that it took."""
        with self._synchronized():
            self._take(call, spent)

    def restore(self, calls: Mapping[str, Amount]) -> None:
        """Takes over the calls of an earlier process, even beyond the limits."""
        with self._synchronized():
            for call, amount in calls.items():
                if self._taken.by_call.get(call) != amount:
                    self._take(call, amount)

    def _check(self, taken: Amount, worst: Amount) -> None:
        """Raises BudgetExhausted unless the limits allow another `worst`."""
        both, cost, tokens = taken.plus(worst), self.max_cost, self.max_tokens
        if cost is not None and worst.usd and both.usd > cost + ROUNDING:
            raise BudgetExhausted(
                f"{format_usd(taken.usd)} of {format_usd(cost)} are spent or reserved, "
                f"and the next question may cost {format_usd(worst.usd)}",
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
    def _synchronized(self) -> Generator[None]:
        """Locks the budget and brings it up to date with the ledger."""
        with self._lock:
            if self._ledger is None:
                yield
                return
            with wait_for(self._ledger):
                self._catch_up(self._ledger)
                yield

    def _catch_up(self, ledger: Path) -> None:
        """Reads what was added to the ledger; all of it if the file was replaced."""
        if ledger.stat().st_size < self._read_to:
            self._taken, self._read_to = _Taken(), 0
        calls, read_to = _read(ledger, self._read_to)
        for call, amount in calls:
            self._taken.put(call, amount)
        self._read_to = read_to


def format_usd(amount: float) -> str:
    """Formats USD, with four decimals below 0.10 USD."""
    return f"{amount:.2f} USD" if amount >= 0.1 or amount == 0 else f"{amount:.4f} USD"


def _read(ledger: Path, offset: int) -> tuple[list[tuple[str, Amount]], int]:
    """Returns the calls recorded after an offset, and the end offset.

    Raises:
        RunError: The file is not a budget ledger.
    """
    try:
        records, end = read_records_from(ledger, offset)
        calls = [(one["call"], Amount(one["tokens"], one["usd"])) for one in records]
    except (KeyError, TypeError, ValueError) as error:
        raise RunError(f"{ledger} is not a budget ledger: {error}") from error
    return calls, end
