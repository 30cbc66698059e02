"""Faults of a simulated drive: what goes wrong, when, and how far the robot went on."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field

import numpy as np

from tdac_envs.core.errors import TaskError, hint

KINDS = {
    "no-scans": "no scan arrives",
    "late-scans": "each scan arrives half a second late",
    "old-scans": "the last scan is sent again and again",
    "nan-scans": "all ranges are NaN",
    "zero-scans": "all ranges are 0",
    "some-nan": "one range of ten is NaN",
    "no-poses": "no pose arrives",
    "pose-jump": "the pose is wrong by 0.3 m and 0.3 rad",
    "unsure-pose": "the localiser states a standard deviation of 1 m",
    "second-publisher": "another node has a publisher of commands",
}
"""Faults of the robot and its sensors; those of the node come from outside."""
OLD, JUMPS = "a scan or a pose is late, lost or old", "the pose jumps or is unsure"
STOPPING = {
    **dict.fromkeys(("no-scans", "late-scans", "old-scans", "nan-scans"), OLD),
    **dict.fromkeys(("zero-scans", "no-poses"), OLD),
    **dict.fromkeys(("pose-jump", "unsure-pose"), JUMPS),
}
"""Faults that stop the robot if they last, with the row of `Settings.stops_within`."""
LATE = 0.5
"""Delay of a late scan, s."""
_FAULT = re.compile(r"([a-z-]+)@(\d+(?:\.\d+)?)\+(\d+(?:\.\d+)?)")


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault and its time.

    Attributes:
        kind: One of `KINDS`.
        begin: Time after the first motion, s.
        lasts: Duration, s.
    """

    kind: str
    begin: float
    lasts: float

    def __str__(self) -> str:
        return f"{self.kind}@{self.begin:g}+{self.lasts:g}"


def read_fault(text: str) -> Fault:
    """The fault of a text such as `nan-scans@3+1.5`.

    Raises:
        TaskError: It is none.
    """
    found = _FAULT.fullmatch(text)
    if found is None:
        raise TaskError(
            f"--fault {text!r}: expected KIND@BEGIN+SECONDS, such as nan-scans@3+1.5"
        )
    if found[1] not in KINDS:
        known = ", ".join(KINDS)
        raise TaskError(
            f"--fault {text!r}: unknown kind; expected {known}{hint(found[1], KINDS)}"
        )
    return Fault(found[1], float(found[2]), float(found[3]))


def drawn_faults(seed: int, count: int, seconds: float) -> tuple[Fault, ...]:
    """Random faults within a drive, one after the other.

    Args:
        seed: Seed.
        count: Number of faults.
        seconds: Duration of the drive without faults.
    """
    random = np.random.default_rng(seed)
    kinds = random.choice([*KINDS], count)
    begins = np.sort(random.uniform(0.0, 0.8 * seconds, count))
    lengths = random.uniform(0.2, 2.0, count)
    return tuple(
        Fault(str(kind), round(float(begin), 2), round(float(length), 2))
        for kind, begin, length in zip(kinds, begins, lengths, strict=True)
    )


@dataclass(slots=True)
class Course:
    """What a robot did in a fault.

    Attributes:
        fault: The fault.
        way: Path driven since the fault began until the robot stood or the fault
            ended, m.
        stood: Whether it stood before the end of the fault.
    """

    fault: Fault
    way: float = 0.0
    stood: bool = False
    _begin: float = field(default=math.nan, repr=False)

    def note(self, time: float, way: float, *, stands: bool) -> bool:
        """Takes the robot's motion so far; returns whether the fault is active.

        Args:
            time: Time after the first motion, s.
            way: Path driven so far, m.
            stands: Whether the robot stands.
        """
        begin, end = self.fault.begin, self.fault.begin + self.fault.lasts
        if not begin <= time < end:
            return False
        if math.isnan(self._begin):
            self._begin = way
        if not self.stood:
            self.way, self.stood = way - self._begin, stands
        return True
