"""Some episodes of a problem: where they take place, and what limits them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from tdac_agent.sandbox import Limits
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.verification.judge.policy_spec import PolicySpec
from tdac_agent.verification.judge.worlds import SetWorlds, TaskWorld
from tdac_envs.physics.moved import EXACT

if TYPE_CHECKING:
    from tdac_envs.ladder.set_limits import CpuSpec


@dataclass(frozen=True, slots=True)
class Part:
    """Some episodes of a problem.

    Attributes:
        numbers: Their numbers: seeds of a task, or worlds of a split.
        split: The split; empty for a task.
        salt_file: File with the salt of hidden worlds.
        disturbance: Disturbance of a task.
        variation: Variation of start and goal of a task.
        physics: What moves the robot: `exact`, or `mujoco`.
    """

    numbers: Sequence[int]
    split: str = ""
    salt_file: Path | None = None
    disturbance: Disturbance | None = None
    variation: str = "jitter"
    physics: str = EXACT

    @property
    def is_hidden(self) -> bool:
        """Whether nothing may be told of single worlds."""
        return self.split == "hidden"

    @property
    def first(self) -> int:
        """Number of the first episode."""
        return self.numbers[0]


def identity_of(own: Episodes) -> dict[str, str]:
    """Fields of provenance in which results on the same problem agree.

    Results of before Ladder 1.0 have no hash of the dynamics, and so are no answer.
    """
    return {"sha256": own.sha256, "dynamics": own.dynamics}


class Episodes(Protocol):
    """The episodes of a task or a task set."""

    @property
    def name(self) -> str:
        """Name of the task or set."""

    @property
    def sha256(self) -> str:
        """Its hash."""

    @property
    def dynamics(self) -> str:
        """Hash of all that decides what happens in an episode, code included."""

    @property
    def checks(self) -> bool:
        """Whether static and contract tests come before the episodes."""

    @property
    def cpu(self) -> CpuSpec | None:
        """CPU budget of a controller; None if only single calls are limited."""

    @property
    def hidden_folder(self) -> Path | None:
        """Folder of hidden worlds that are files."""

    @property
    def longest(self) -> float:
        """Longest simulated time of an episode, s."""

    @property
    def limits(self) -> Limits:
        """Limits of an episode's process."""

    def compile(self) -> None:
        """Compiles what the episodes need, unless compiled code is cached."""

    def check(self, policy: PolicySpec) -> None:
        """Checks that a kind of policy drives here.

        Raises:
            TaskError: It does not.
        """

    def secret(self, part: Part) -> str | None:
        """Hash of what hides the worlds: the salt, or the worlds of a folder."""

    def different(self, part: Part) -> int | None:
        """Number of different worlds, if each may be driven several times."""

    def worlds(
        self, part: Part, folder: Path, policy: PolicySpec
    ) -> TaskWorld | SetWorlds:
        """Lays out in a folder what the judge needs."""

    def provenance(
        self, part: Part, folder: Path, sha256: str, tier: str, limits: Limits
    ) -> dict[str, Any]:
        """Fields of `EpisodeProvenance`.

        Args:
            part: The episodes.
            folder: The folder of `worlds`.
            sha256: Hash of the policy's file.
            tier: Sandbox tier.
            limits: Limits of an episode's process.
        """
