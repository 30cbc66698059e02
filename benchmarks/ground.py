"""The setups of the mutation score: one for each kind of task."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from benchmarks import epuck_oracles, independent_oracles
from benchmarks.ground_epuck import good_drivers, small_world
from benchmarks.ground_map2d import good_controllers, small_task
from benchmarks.mutants import Original
from tdac_agent.sandbox import Child
from tdac_agent.tasks.task import Task


@dataclass(frozen=True, slots=True)
class Ground:
    """A task, its good controllers, and the extent of the tests.

    Attributes:
        results: Name of the result files.
        task: Makes the task.
        originals: Returns good controllers for it.
        violations: Yields a file's violations of the contract of profile `paper`.
        domain: Number of mutants from domain-specific mistakes.
        syntactic: Number of mutants from cosmic-ray.
        seeds: Number of jittered starts that the independent judge uses.
    """

    results: str
    task: Callable[[], Task]
    originals: Callable[[Task], list[Original]]
    violations: Callable[[Child, Task, str], Iterator[str]]
    domain: int
    syntactic: int
    seeds: int

    @property
    def starts(self) -> Sequence[int]:
        """Seeds of the jittered starts."""
        return range(7_000_001, 7_000_001 + self.seeds)

    @property
    def failures_allowed(self) -> int:
        """Most failures with which at least 90 % of the starts succeed."""
        return self.seeds // 10


GROUNDS = {
    "map2d": Ground(
        "mutation",
        small_task,
        good_controllers,
        independent_oracles.contract_violations,
        domain=205,
        syntactic=105,
        seeds=50,
    ),
    "epuck": Ground(
        "mutation_epuck",
        small_world,
        good_drivers,
        epuck_oracles.contract_violations,
        domain=81,
        syntactic=24,
        seeds=20,
    ),
}
"""Setups by kind of task."""
