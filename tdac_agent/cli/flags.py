"""Builds a task from the command line's flags."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal

from tdac_agent.runs.ownership import load_task
from tdac_agent.sandbox import TIERS
from tdac_agent.tasks.registry import environment_with_key
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.task_file import TaskFile, checked
from tdac_envs.core.errors import TaskError
from tdac_envs.core.intake import TEXT_BYTES, read_file
from tdac_envs.map2d.source import check_exists
from tdac_envs.mapping.bundled import bundled_map, bundled_maps
from tdac_envs.mapping.params import FrameName

FIXED_BY_TASK = (
    *("map_image", "world", "ignore", "start", "goal", "heading", "robot_radius"),
    *("robot_image", "movers", "snap", "polarity", "threshold", "instructions"),
)
ONLY_FOR_MAPS = (
    *("map_image", "robot_radius", "robot_image", "movers", "snap", "frame"),
    *("polarity", "threshold"),
)


@dataclass(frozen=True, slots=True)
class TaskFlags:
    """The flags that name a task; see `tdac synth --help`."""

    task: str | None = None
    map_image: str | None = None
    world: str | None = None
    ignore: tuple[str, ...] = ()
    start: tuple[float, float] | None = None
    goal: tuple[float, float] | None = None
    heading: float | None = None
    robot_radius: float | None = None
    robot_image: Path | None = None
    movers: str | None = None
    snap: bool = False
    frame: FrameName | None = None
    polarity: Literal["dark", "light"] | None = None
    threshold: float | None = None
    instructions: str | None = None

    @property
    def in_metres(self) -> bool:
        """Whether the user gives and reads metres."""
        return self.frame == "metres"

    def load_beside(self, folder: Path) -> Task:
        """The task that `--task`, `--map` or `--world` names, or that of a folder.

        Raises:
            TaskError: Other flags would change the folder's task, or the task cannot be
                used.
        """
        if self.task or self.map_image or self.world:
            return self.load()
        others = {each.name for each in fields(self)} - {"frame"}
        self._refuse(f"{folder} brings its own task", sorted(others))
        return self._shown(load_task(folder))

    def words(self) -> list[str]:
        """The command line words that repeat these flags."""
        words = []
        for name in (f.name for f in fields(self)):
            value = getattr(self, name)
            if value is None or value is False or name == "ignore":
                continue
            if name == "frame":
                words += ["--metres"] if self.in_metres else []
                continue
            values = value if isinstance(value, tuple) else (value,)
            given = [] if value is True else map(as_word, values)
            words += [flag(name), *given]
        return words + [word for name in self.ignore for word in ("--ignore", name)]

    def load(self, default: str = "maze") -> Task:
        """The task that the flags describe.

        Raises:
            TaskError: The flags contradict each other, or the task cannot be used.
            MapError: There is no such map.
        """
        check_finite(start=self.start, goal=self.goal)
        check_heading(self.heading)
        check_radius(self.robot_radius)
        if self.task is not None:
            self._refuse("--task already defines the task", FIXED_BY_TASK)
            return self._shown(load_task(self.task))
        if self.world is not None:
            self._refuse("--world defines an e-puck task", ONLY_FOR_MAPS)
            return load_task(self._world_spec(self.world), base=Path())
        self._refuse("--ignore needs --world", ("ignore",))
        source = self.map_image or default
        own = source not in bundled_maps()
        if own:
            check_exists(Path(source))
        if own and (self.start is None or self.goal is None):
            raise TaskError(
                f"the map {source!r} needs --start X Y and --goal X Y "
                f"({_rulers(Path(source), self.in_metres)})"
            )
        return load_task(self._spec(source), base=Path())

    def _shown(self, task: Task) -> Task:
        """The task, with `--metres` shown in metres of the map's frame."""
        if not self.in_metres:
            return task
        return replace(task, setting=task.setting.in_metres())

    def _refuse(self, why: str, names: Sequence[str]) -> None:
        """Refuses flags that would have no effect.

        Raises:
            TaskError: One of these flags is given.
        """
        given = [name for name in names if getattr(self, name) not in (None, (), False)]
        if given:
            flags = ", ".join(map(flag, given))
            raise TaskError(f"{why}: leave out {flags}")

    def _world_spec(self, world: str) -> TaskFile:
        start: tuple[float, ...] | None = self.start
        if self.heading is not None:
            if start is None:
                raise TaskError("--heading needs --start X Y")
            start = (*start, self.heading)
        given = {
            "env": environment_with_key("world").id,
            "world": world,
            "ignore": self.ignore,
            "start": start,
            "goal": self.goal,
            "instructions": _text(self.instructions),
        }
        return _checked(given)

    def _spec(self, source: str) -> TaskFile:
        start: tuple[float, ...] | None = self.start
        goal, radius = self.goal, self.robot_radius
        if self.in_metres and source in bundled_maps():
            raise TaskError("--metres needs a --map with a resolution, as in map.yaml")
        if source in bundled_maps() and start is None:
            start = bundled_map(source).start
        if start is not None and self.heading is not None:
            start = (*start, self.heading)
        given = {
            "map": source,
            "start": start,
            "goal": goal,
            "movers": self.movers,
            "snap": self.snap,
            "frame": self.frame or "pixels",
            "polarity": self.polarity,
            "threshold": self.threshold,
            "robot": {"radius": radius, "image": self.robot_image},
            "instructions": _text(self.instructions),
        }
        return _checked(given)


def frame_of(frame: FrameName | None, metres: bool) -> FrameName | None:
    """The frame that `--frame` and `--metres` choose; None for neither.

    Raises:
        TaskError: They contradict each other.
    """
    if metres and frame == "pixels":
        raise TaskError("--metres is --frame metres: leave out --frame pixels")
    return "metres" if metres else frame


def _rulers(map_file: Path, metres: bool) -> str:
    """Where to read places on a map."""
    if metres:
        return "read them off the rulers that `tdac map IMAGE --metres` draws"
    text = "read them off the rulers that `tdac map IMAGE` draws"
    if map_file.suffix in (".yaml", ".yml"):
        text += "; for places in metres, give --metres to both commands"
    return text


def _checked(given: dict[str, Any]) -> TaskFile:
    """The task file that the flags stand for; an error names the flag."""
    try:
        return checked(given, "flags")
    except TaskError as error:
        key, _, reason = str(error).removeprefix("flags: ").partition(": ")
        name = key.replace("robot.", "robot_").partition(".")[0]
        raise TaskError(f"{flag(name)}: {reason}") from error


def flag(field: str) -> str:
    """The flag of a field, as in `--robot-radius`."""
    return "--map" if field == "map_image" else f"--{field.replace('_', '-')}"


def as_word(value: object) -> str:
    """A flag's value as typed on a command line; a number keeps all its digits."""
    return repr(value).removesuffix(".0") if isinstance(value, float) else str(value)


def check_tier(name: str) -> None:
    """Checks the name of a sandbox tier.

    Raises:
        TaskError: There is no such tier.
    """
    names = ("auto", *(tier.name for tier in TIERS))
    if name not in names:
        known = ", ".join(names)
        raise TaskError(f"unknown sandbox tier {name!r}; expected one of {known}")


def check_finite(**points: tuple[float, ...] | None) -> None:
    """Refuses `nan` and `inf`, which the command line parses as numbers.

    Raises:
        TaskError: A coordinate is not finite.
    """
    for name, point in points.items():
        if point is not None and not all(map(math.isfinite, point)):
            given = " ".join(map(str, point))
            raise TaskError(f"--{name} must be finite, got {given}")


def check_heading(heading: float | None) -> None:
    """Refuses degrees: a heading of more than a full turn.

    Raises:
        TaskError: The heading is not finite, or larger than 2 pi.
    """
    check_finite(heading=None if heading is None else (heading,))
    if heading is not None and abs(heading) > 2.0 * math.pi + 1e-3:
        turn = math.remainder(math.radians(heading), 2.0 * math.pi)
        raise TaskError(
            f"--heading (the YAW of --start) is in radians, and {heading:g} is more "
            f"than a full turn: did you mean {turn:.4g} ({heading:g} degrees)?"
        )


def check_radius(radius: float | None) -> None:
    """Checks the body radius.

    Raises:
        TaskError: It is not greater than 0.
    """
    if radius is not None and not radius > 0:
        raise TaskError(f"--robot-radius must be greater than 0, got {radius:g}")


def _text(given: str | None) -> str:
    """The user's instructions: the given text, or the contents of the file it names."""
    if given is None:
        return ""
    path = Path(given)
    if len(given) < 250 and "\n" not in given and path.is_file():
        try:
            return read_file(path, TEXT_BYTES).decode("utf-8", "replace")
        except OSError as error:
            raise TaskError(f"cannot read {given}: {error.strerror}") from error
    return given
