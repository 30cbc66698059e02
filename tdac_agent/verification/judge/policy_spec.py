"""Which policy drives: a controller, a learned policy, or a baseline."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

Kind = Literal[
    "controller",
    "sb3",
    "reference",
    "random",
    "go-to-goal",
    "follow-guidance",
    "privileged",
]


@dataclass(frozen=True, slots=True)
class PolicySpec:
    """Which policy a job lets drive.

    Attributes:
        kind: Kind of policy.
        file: File of a controller, or of a policy of stable-baselines3.
        wrappers: Names of the observation wrappers of such a policy.
        on_level: Whether a controller reads the files of a task set on a task, too.
    """

    kind: Kind
    file: Path | None = None
    wrappers: tuple[str, ...] = ()
    on_level: bool = False

    @property
    def knows(self) -> str:
        """Label of the information it may use; `sensors` includes pose and goal."""
        if self.kind == "controller":
            return "+ map"
        if self.kind == "follow-guidance" or "guidance" in self.wrappers:
            return "+ guidance"
        if self.kind == "reference":
            return "privileged"
        return "nothing" if self.kind == "random" else "sensors"
