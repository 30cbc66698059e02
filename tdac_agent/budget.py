"""Spending limits: the worst case of a call is reserved before the call is made.

The public names of `tdac_agent.models.budget`.
"""

from tdac_agent.models.budget import (
    NOTHING,
    ROUNDING,
    Amount,
    Budget,
    BudgetExhausted,
    Limit,
    format_usd,
)

__all__ = [
    "NOTHING",
    "ROUNDING",
    "Amount",
    "Budget",
    "BudgetExhausted",
    "Limit",
    "format_usd",
]
