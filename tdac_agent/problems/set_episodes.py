"""The episodes of a task set."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from tdac_agent.problems.part import Part, identity_of
from tdac_agent.sandbox import Limits
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.tasks.first_run import compile_first
from tdac_agent.tasks.provenance import versions
from tdac_agent.tasks.registry import environment
from tdac_agent.tasks.units import frame_of
from tdac_agent.verification.judge.policy_spec import PolicySpec
from tdac_agent.verification.judge.set_files import write_set
from tdac_agent.verification.judge.set_worlds import printed_units
from tdac_agent.verification.judge.worlds import SetWorlds
from tdac_envs.core.errors import TaskError
from tdac_envs.core.salt import read_salt
from tdac_envs.epuck.task import EPuckTask
from tdac_envs.ladder import orca_driver, space_time
from tdac_envs.ladder.set_limits import CpuSpec
from tdac_envs.ladder.task_sets import TaskSet
from tdac_envs.map2d.task import Map2DTask

ON_SETS = (
    *("controller", "sb3", "random", "reference", "go-to-goal", "follow-waypoints"),
    "privileged",
)
"""Kinds of policy that drive on task sets."""


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
    def dynamics(self) -> str:
        """See `Episodes`."""
        return self.tasks.dynamics

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
        if self.tasks.file.is_epuck:  # its generated worlds are measured as maps
            parts += environment(EPuckTask.env_id).code_parts(movers=movers)
        compile_first(parts)

    def check(self, policy: PolicySpec) -> None:
        """See `Episodes`."""
        if policy.kind not in ON_SETS:
            raise TaskError(
                f"{policy.kind} does not drive on a task set: give controller files, "
                "run folders, .zip files of stable-baselines3, builtin, reference, "
                "go-to-goal, follow-waypoints or random"
            )
        if policy.kind == "privileged" and not self.tasks.file.movers:
            raise TaskError(
                "without movers, a planner that knows the world takes the least "
                "possible time: its time score is 1 by definition"
            )
        if policy.kind == "follow-waypoints" and self.tasks.file.is_epuck:
            raise TaskError("follow-waypoints needs ranges, and an e-puck has none")
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
            physics=part.physics,
        )

    def provenance(
        self, part: Part, folder: Path, sha256: str, tier: str, limits: Limits
    ) -> dict[str, Any]:
        """See `Episodes`."""
        del folder
        return {
            "name": self.name,
            **identity_of(self),
            "split": part.split,
            "salt_sha256": self.secret(part),
            "first": part.first,
            "physics": part.physics,
            "unit": self.tasks.file.unit,
            "frame": frame_of(printed_units(self.tasks.file)),
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
