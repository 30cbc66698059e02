"""The tiers of the sandbox, best first, and what each of them promises.

Every tier limits time, memory, descriptors, file size and output, scrubs the
environment, and ends the child with its judge. Where the kernel filters system calls,
`rlimits` denies network and processes too, yet promises nothing. Under `landlock` a
controller can learn whether a path exists, and its scratch folder is bounded by the
file and not in all; a tmpfs bounds it under the two tiers above.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Tier:
    """One way to confine a child.

    Each start checks, in the child, that what the tier promises holds.

    Attributes:
        name: As named in a verdict.
        steps: What the child applies to itself after it has imported numpy.
        promises: Of `hides_files` (only what it needs can be read), `hides_names`
            (nor can it be asked whether others exist), `denies_network` and
            `denies_processes` (no fork, no program, no thread).
    """

    name: str
    steps: tuple[str, ...]
    promises: tuple[str, ...]


ALL_PROMISES = ("hides_files", "hides_names", "denies_network", "denies_processes")
BUT_NAMES = ("hides_files", "denies_network", "denies_processes")
# Landlock inside of bubblewrap keeps the children of one zygote from one another.
INSIDE = ("end with parent", "rlimits", "landlock if offered", "seccomp")
TIERS = (
    Tier("bubblewrap", INSIDE, ALL_PROMISES),
    Tier("namespaces", ("namespaces", "rlimits", "seccomp"), ALL_PROMISES),
    Tier("landlock", ("rlimits", "landlock", "seccomp"), BUT_NAMES),
    Tier("rlimits", ("rlimits", "seccomp if offered"), ()),
)
# One that promises nothing is used where it is named, never by itself.
CONFINING = tuple(tier for tier in TIERS if tier.promises)


@dataclass(frozen=True, slots=True)
class TierStatus:
    """Whether a tier works on this machine.

    Attributes:
        tier: The tier.
        works: Whether a child starts in it and finds its promises to hold.
        reason: Why it does not work, or an empty text.
    """

    tier: Tier
    works: bool
    reason: str

    @property
    def withdrawn(self) -> tuple[str, ...]:
        """What this tier does not promise."""
        return tuple(p for p in ALL_PROMISES if p not in self.tier.promises)
