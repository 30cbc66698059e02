"""The episodes of a task or a task set: where they take place, and what limits them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol

from tdac_agent.sandbox import Limits
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.first_run import compile_first
from tdac_agent.tasks.provenance import origin, versions
from tdac_agent.tasks.registry import environment
from tdac_agent.tasks.task import Task, lay_out
from tdac_agent.verification.judge.drivers import PolicySpec
from tdac_agent.verification.judge.set_files import write_set
from tdac_agent.verification.judge.worlds import SetWorlds, TaskWorld
from tdac_envs.core.errors import TaskError
from tdac_envs.epuck.task import EPuckTask
from tdac_envs.ladder import orca_driver, space_time
from tdac_envs.ladder.set_file import CpuSpec
from tdac_envs.ladder.source import read_salt
from tdac_envs.ladder.task_sets import TaskSet
from tdac_envs.map2d.task import Map2DTask

ON_SETS = ("controller", "sb3", "random", "reference", "go-to-goal", "privileged")
"""Kinds of policy that drive on task sets."""


@dataclass(frozen=True, slots=True)
class Part:
    """Some episodes of a problem.

    Attributes:
        numbers: Their numbers: seeds of a task, or worlds of a split.
        split: The split; empty for a task.
        salt_file: File with the salt of hidden worlds.
        disturbance: Disturbance of a task.
        variation: Variation of start and goal of a task.
    """

    numbers: Sequence[int]
    split: str = ""
    salt_file: Path | None = None
    disturbance: Disturbance | None = None
    variation: str = "jitter"

    @property
    def is_hidden(self) -> bool:
        """Whether nothing may be told of single worlds."""
        return self.split == "hidden"

    @property
    def first(self) -> int:
        """Number of the first episode."""
        return self.numbers[0]


class Episodes(Protocol):
    """The episodes of a task or a task set."""

    @property
    def name(self) -> str:
        """Name of the task or set."""

    @property
    def sha256(self) -> str:
        """Its hash."""

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


def episodes_of(problem: Task | TaskSet) -> Episodes:
    """The episodes of a task or a task set."""
    return OfSet(problem) if isinstance(problem, TaskSet) else OfTask(problem)


@dataclass(frozen=True, slots=True)
class OfTask:
    """See `Episodes`."""

    task: Task
    checks = False
    cpu = None
    hidden_folder = None

    @property
    def name(self) -> str:
        """See `Episodes`."""
        return self.task.name

    @property
    def sha256(self) -> str:
        """See `Episodes`."""
        return self.task.sha256()

    @property
    def longest(self) -> float:
        """See `Episodes`."""
        return self.task.nominal.horizon * self.task.nominal.dt

    @property
    def limits(self) -> Limits:
        """See `Episodes`."""
        return Limits()

    def compile(self) -> None:
        """See `Episodes`. It was compiled when the task was read."""

    def check(self, policy: PolicySpec) -> None:
        """See `Episodes`."""
        if policy.kind == "privileged":
            raise TaskError("privileged drives on task sets with movers alone")

    def secret(self, part: Part) -> str | None:
        """See `Episodes`. A task hides nothing."""
        del part
        return None

    def different(self, part: Part) -> int | None:
        """See `Episodes`. Each seed has its own."""
        del part
        return None

    def worlds(self, part: Part, folder: Path, policy: PolicySpec) -> TaskWorld:
        """See `Episodes`."""
        return TaskWorld(
            on_level=policy.on_level,
            task=lay_out(self.task, folder / "work"),
            disturbance=part.disturbance or self.task.own_disturbance(),
            variation=part.variation,
        )

    def provenance(
        self, part: Part, folder: Path, sha256: str, tier: str, limits: Limits
    ) -> dict[str, Any]:
        """See `Episodes`."""
        facts = origin(self.task, b"", folder / "work", tier, limits)
        return {
            **facts,
            "controller_sha256": sha256,
            "disturbance": part.disturbance or self.task.own_disturbance(),
            "variation": part.variation,
            "first": part.first,
        }


@dataclass(frozen=True, slots=True)
class OfSet:
    """See `Episodes`."""

    tasks: TaskSet
    checks = True

    @property
    def name(self) -> str:
        """See `Episodes`."""
        return self.tasks.name

    @property
    def sha256(self) -> str:
        """See `Episodes`."""
        return self.tasks.sha256

    @property
    def cpu(self) -> CpuSpec:
        """See `Episodes`."""
        return self.tasks.file.cpu

    @property
    def hidden_folder(self) -> Path | None:
        """See `Episodes`."""
        return None if self.tasks.files is None else self.tasks.files.hidden_folder

    @property
    def longest(self) -> float:
        """See `Episodes`."""
        return self.tasks.file.horizon.most * self.tasks.file.dt

    @property
    def limits(self) -> Limits:
        """See `Episodes`. The CPU budget ends most episodes before."""
        most = self.cpu.start + self.cpu.of_steps(self.tasks.file.horizon.most)
        return Limits(cpu_seconds=math.ceil(2.0 * most) + 1)

    def compile(self) -> None:
        """See `Episodes`."""
        movers = bool(self.tasks.file.movers)
        parts = environment(Map2DTask.env_id).code_parts(movers=movers, worlds=True)
        if self.tasks.file.unit == "m":  # its generated worlds are measured as maps
            parts += environment(EPuckTask.env_id).code_parts(movers=movers)
        compile_first(parts)

    def check(self, policy: PolicySpec) -> None:
        """See `Episodes`."""
        if policy.kind not in ON_SETS:
            raise TaskError(
                f"{policy.kind} does not drive on a task set: give controller files, "
                "run folders, .zip files of stable-baselines3, builtin, reference, "
                "go-to-goal or random"
            )
        if policy.kind == "privileged" and not self.tasks.file.movers:
            raise TaskError(
                "without movers, a planner that knows the world takes the least "
                "possible time: its time score is 1 by definition"
            )
        if policy.kind == "go-to-goal" and "pose" not in self.tasks.file.observed:
            raise TaskError(
                f"go-to-goal needs a pose, and {self.name} does not observe one"
            )

    def secret(self, part: Part) -> str | None:
        """See `Episodes`."""
        if not part.is_hidden:
            return None
        if part.salt_file is not None:
            return sha256_of(read_salt(part.salt_file))
        assert self.tasks.files is not None
        return self.tasks.files.hidden_sha256

    def different(self, part: Part) -> int | None:
        """See `Episodes`."""
        return self.tasks.different(part.split)

    def worlds(self, part: Part, folder: Path, policy: PolicySpec) -> SetWorlds:
        """See `Episodes`."""
        del policy
        salt = part.salt_file
        return SetWorlds(
            set_file=write_set(self.tasks, folder / "set.yaml"),
            split=part.split,
            salt_file=None if salt is None else salt.resolve(),
            hidden_folder=self.hidden_folder if part.is_hidden else None,
        )

    def provenance(
        self, part: Part, folder: Path, sha256: str, tier: str, limits: Limits
    ) -> dict[str, Any]:
        """See `Episodes`."""
        del folder
        return {
            "name": self.name,
            "sha256": self.sha256,
            "split": part.split,
            "salt_sha256": self.secret(part),
            "first": part.first,
            "unit": self.tasks.file.unit,
            "controller_sha256": sha256,
            "sandbox": tier,
            "limits": asdict(limits),
            "versions": dict(versions()),
        }


def planner_sha256() -> str:
    """Hash of the source code of the planners that know the world in advance."""
    files = (space_time.__file__, orca_driver.__file__)
    # raw read: shipped
    return sha256_of(b"".join(Path(file).read_bytes() for file in files))
