"""The tiers of the sandbox, best first, and the promises of each.

Every tier limits time, memory, descriptors, file size and output, scrubs the
environment, and kills the child when its judge ends. `bubblewrap` and `namespaces`
limit the whole scratch folder with a tmpfs; the other tiers limit each file in it.
Under `landlock` a controller can find out whether a path exists. `rlimits` promises
nothing, but denies network and processes if the kernel can filter system calls.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Tier:
    """One way to confine a child.

    At each start the child checks that the promises of its tier hold.

    Attributes:
        name: Name in verdicts.
        steps: Confinement steps that the child takes after it has imported numpy.
        promises: Some of `hides_files` (only needed files can be read), `hides_names`
            (the child cannot find out whether other files exist), `denies_network` and
            `denies_processes` (no fork, no program, no thread).
    """

    name: str
    steps: tuple[str, ...]
    promises: tuple[str, ...]


ALL_PROMISES = ("hides_files", "hides_names", "denies_network", "denies_processes")
ALL_BUT_NAMES = ("hides_files", "denies_network", "denies_processes")
# Inside bubblewrap, Landlock separates the children of one zygote.
BUBBLEWRAP_STEPS = ("end with parent", "rlimits", "landlock if offered", "seccomp")
TIERS = (
    Tier("bubblewrap", BUBBLEWRAP_STEPS, ALL_PROMISES),
    Tier("namespaces", ("namespaces", "rlimits", "seccomp"), ALL_PROMISES),
    Tier("landlock", ("rlimits", "landlock", "seccomp"), ALL_BUT_NAMES),
    Tier("rlimits", ("rlimits", "seccomp if offered"), ()),
)
# A tier without promises is used only where it is named explicitly.
CONFINING = tuple(tier for tier in TIERS if tier.promises)


@dataclass(frozen=True, slots=True)
class TierStatus:
    """Whether a tier works on this machine.

    Attributes:
        tier: The tier.
        works: Whether a child starts in it and the promises hold.
        reason: Why it does not work; empty if it does.
    """

    tier: Tier
    works: bool
    reason: str

    @property
    def withdrawn(self) -> tuple[str, ...]:
        """Promises that this tier does not make."""
        return tuple(p for p in ALL_PROMISES if p not in self.tier.promises)
