"""The episodes of a problem, which is a task or a task set."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tdac_agent.problems.part import Episodes, Part
from tdac_agent.sandbox import Limits
from tdac_agent.tasks.provenance import origin
from tdac_agent.tasks.task import Task, lay_out
from tdac_agent.tasks.units import frame_of
from tdac_agent.verification.judge.policy_spec import PolicySpec
from tdac_agent.verification.judge.worlds import TaskWorld, public_split
from tdac_envs.core.errors import TaskError
from tdac_envs.physics.moved import EXACT, engine_named

if TYPE_CHECKING:
    from tdac_envs.ladder.task_sets import TaskSet


def episodes_of(problem: Task | TaskSet) -> Episodes:
    """The episodes of a task or a task set."""
    if isinstance(problem, Task):
        return OfTask(problem)
    # Task sets need much that a task does not.
    from tdac_agent.problems.set_episodes import OfSet

    return OfSet(problem)


def check_physics(problem: Task | TaskSet, physics: str) -> None:
    """Checks before the work begins that a physics can drive on a problem.

    Raises:
        TaskError: It is unknown or not installed, or cannot drive there.
    """
    if engine_named(physics) == EXACT:
        return
    if isinstance(problem, Task):
        problem.make_env(physics=physics)
        return
    # Task sets need much that a task does not.
    from tdac_agent.verification.judge.set_files import write_set
    from tdac_envs.ladder.env import make

    split = public_split(problem)
    assert split is not None
    with tempfile.TemporaryDirectory(prefix="tdac-set-") as name:
        file = write_set(problem, Path(name) / "set.yaml")
        make(file, split=split, physics=physics)


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
    def dynamics(self) -> str:
        """See `Episodes`."""
        return self.task.dynamics()

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
            physics=part.physics,
        )

    def provenance(
        self, part: Part, folder: Path, sha256: str, tier: str, limits: Limits
    ) -> dict[str, Any]:
        """See `Episodes`."""
        facts = origin(self.task, b"", folder / "work", tier, limits)
        facts["frame"] = frame_of(self.task.setting.shown)
        return {
            **facts,
            "controller_sha256": sha256,
            "disturbance": part.disturbance or self.task.own_disturbance(),
            "variation": part.variation,
            "first": part.first,
            "physics": part.physics,
        }
