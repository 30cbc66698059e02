"""Which policy drives: a controller, a learned policy, or a baseline."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from tdac_agent.storage.files import write_atomic

Kind = Literal[
    "controller",
    "sb3",
    "reference",
    "random",
    "go-to-goal",
    "follow-guidance",
    "follow-waypoints",
    "privileged",
]


@dataclass(frozen=True, slots=True)
class PolicySpec:
    """Which policy a job lets drive.

    Attributes:
        kind: Kind of policy.
        file: File of a controller, or of a policy of stable-baselines3.
        wrappers: Names of the observation wrappers of such a policy.
        weights: File with the numbers of a learned controller.
        on_level: Whether a controller reads the files of a task set on a task, too.
    """

    kind: Kind
    file: Path | None = None
    wrappers: tuple[str, ...] = ()
    weights: Path | None = None
    on_level: bool = False

    @property
    def knows(self) -> str:
        """Label of the information it may use; `sensors` includes pose and goal.

        A memory is a map of what its rays showed, a planner finds ways on this map.
        """
        if self.kind == "controller":
            return "+ map"
        if self.kind == "follow-guidance" or "guidance" in self.wrappers:
            return "+ guidance"
        if self.kind == "reference":
            return "privileged"
        if self.kind == "follow-waypoints" or "waypoints" in self.wrappers:
            return "+ planner"
        if "seen-map" in self.wrappers:
            return "+ memory"
        return "nothing" if self.kind == "random" else "sensors"


def written(
    policy: PolicySpec, folder: Path, source: bytes | None, weights: bytes | None
) -> PolicySpec:
    """A policy with files of its own, which nobody else changes.

    Args:
        policy: The policy.
        folder: Folder in which the files are written.
        source: Source of a controller; None for the file that the policy has.
        weights: Content of its weights, if it has any.
    """
    if source is not None:
        policy = replace(policy, file=folder / "controller.py")
        write_atomic(folder / "controller.py", source)
    if weights is not None:
        policy = replace(policy, weights=folder / "controller.npz")
        write_atomic(folder / "controller.npz", weights)
    return policy
