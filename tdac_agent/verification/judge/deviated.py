"""Episodes in which something differs from what the controller is told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from tdac_agent.episodes.deviated import DeviatedEnv
from tdac_agent.episodes.episode import Driver, Record
from tdac_agent.sandbox import Child
from tdac_agent.tasks.deviation import Deviation
from tdac_agent.tasks.setting import JudgedEnv, Nominal
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.units import Units
from tdac_agent.verification.judge.task_world import TaskEpisodes
from tdac_agent.verification.judge.worlds import FOREVER, Case, Program
from tdac_envs.drive.env import Observation
from tdac_envs.drive.task import Pose
from tdac_envs.physics.moved import EXACT

if TYPE_CHECKING:
    from tdac_agent.verification.judge.set_worlds import SetEpisodes

_PLACED = "start_x", "start_y", "heading", "obstacles_x", "obstacles_y"


@dataclass(frozen=True, slots=True)
class DeviatedEpisodes:
    """See `Worlds`. The number of an episode is that of its case.

    Attributes:
        plain: The episodes without deviations.
        cases: The cases by their numbers.
    """

    plain: TaskEpisodes | SetEpisodes
    cases: Mapping[int, Case]
    _known: dict[tuple[int, Deviation], dict[str, Any]] = field(default_factory=dict)

    @property
    def units(self) -> Units:
        """See `Worlds`."""
        return self.plain.units

    def record(self, number: int, most: int = FOREVER) -> Record:
        """See `Worlds`."""
        case, plain = self.cases[number], self.plain
        if isinstance(plain, TaskEpisodes):
            world, start = plain.worlds, None
            how = world.disturbance, world.variation, world.physics
            env = shifted_env(plain.task, case.deviation, *how)
            if world.variation == "nominal":
                start = start_of(plain.task.nominal, case.deviation)
            record = Record(env, start, most, seed=case.number)
        else:
            record = plain.record(case.number, most)
        record.env = DeviatedEnv(record.env, case.deviation, case.number)
        return record

    def name(self, number: int) -> str:
        """See `Worlds`."""
        return f"case {number}"

    def supply(self, child: Child, number: int, program: Program) -> None:
        """See `Worlds`. The files say nothing of the deviation."""
        self.plain.supply(child, self.cases[number].number, program)

    def seen(self, observation: Observation) -> Observation:
        """See `Worlds`."""
        return self.plain.seen(observation)

    def load(self, child: Child) -> Driver:
        """See `Worlds`."""
        return self.plain.load(child)

    def facts(self, env: JudgedEnv, number: int) -> dict[str, Any]:
        """See `Worlds`."""
        case = self.cases[number]
        place = case.number, placed(case.deviation)
        facts = self._known.get(place)
        if facts is None:
            facts = self.plain.facts(env, case.number)
            self._known[place] = facts
        key = "seed" if "seed" in facts else "index"
        return {**facts, key: number}

    def diagnosed(self, env: JudgedEnv) -> tuple[Nominal, Units | None]:
        """See `Worlds`."""
        return self.plain.diagnosed(env)


def placed(deviation: Deviation) -> Deviation:
    """The parts of a deviation that move the start or the obstacles."""
    own = deviation.parts().items()
    return Deviation.of({name: value for name, value in own if name in _PLACED})


def shifted_env(
    task: Task,
    deviation: Deviation,
    disturbance: Any,
    variation: str = "nominal",
    physics: str = EXACT,
) -> JudgedEnv:
    """The environment of a task whose obstacles are shifted.

    Raises:
        TaskError: Start or goal are not feasible there.
    """
    options = task.disturbed_options(disturbance) | {"variation": variation}
    x, y = deviation.obstacles_x, deviation.obstacles_y
    if x or y:
        radius = task.nominal.body_radius
        options |= task.setting.displaced(x * radius, y * radius)
    if physics != EXACT:
        options["physics"] = physics
    return task.make_env(**options)


def start_of(nominal: Nominal, deviation: Deviation) -> Pose:
    """The start of an episode, shifted and turned."""
    radius, own = nominal.body_radius, nominal.start
    x = own.x + deviation.start_x * radius
    y = own.y + deviation.start_y * radius
    return Pose(x, y, own.heading + deviation.heading)
