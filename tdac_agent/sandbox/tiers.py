"""The tiers of the sandbox, best first, and what each of them promises."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Tier:
    """One way to confine a child.

    Attributes:
        name: As named in a verdict.
        steps: What the child applies to itself after it has imported numpy.
        hides_files: Whether it promises that other files cannot be read.
        denies_network: Whether it promises that there is no network.
    """

    name: str
    steps: tuple[str, ...]
    hides_files: bool
    denies_network: bool


TIERS = (
    Tier("bubblewrap", ("rlimits",), True, True),
    Tier("rlimits", ("rlimits",), False, False),
)
