"""Controllers that put a suite to the proof: one that must pass, others that must not.

All are one file that knows the oracle's path for the starts of one task and seed, and
differ in their `policy` alone.
"""

from __future__ import annotations

from tdac_agent.verification.suite.privileged.controllers import (
    BAD,
    DO_NOTHING,
    POLICIES,
    REFERENCE,
    SLOW,
    privileged_controller,
    reference_ways,
)

__all__ = [
    "BAD",
    "DO_NOTHING",
    "POLICIES",
    "REFERENCE",
    "SLOW",
    "privileged_controller",
    "reference_ways",
]
