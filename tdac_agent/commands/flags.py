"""A task from the command line's flags."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tdac_agent.task import RobotSpec, Task, TaskFile, load_task
from tdac_envs.errors import TaskError
from tdac_envs.maps import bundled_maps


@dataclass(frozen=True, slots=True)
class TaskFlags:
    """The flags that name a task; see `tdac synth --help`."""

    task: str | None = None
    map_image: str | None = None
    start: tuple[float, float] | None = None
    goal: tuple[float, float] | None = None
    heading: float | None = None
    robot_radius: float | None = None
    robot_image: Path | None = None
    snap: bool = False
    metres: bool = False
    instructions: str | None = None

    def given(self) -> bool:
        """Whether any flag names or changes a task."""
        return self != TaskFlags()

    def load(self, default: str = "maze") -> Task:
        """The task that the flags ask for.

        Raises:
            TaskError: They contradict each other, or the task cannot be used.
        """
        if self.task is not None:
            self._refuse_with_task()
            return load_task(self.task)
        source = self.map_image or default
        own = source not in bundled_maps()
        if own and (self.start is None or self.goal is None):
            raise TaskError(
                f"give --start X Y and --goal X Y for {source!r} "
                "(`tdac map IMAGE` draws rulers to read them off)"
            )
        return load_task(self._spec(source), base=Path())

    def _refuse_with_task(self) -> None:
        names = ("map_image", "start", "goal", "heading", "robot_radius")
        given = [name for name in names if getattr(self, name) is not None]
        if given:
            flags = ", ".join("--" + n.replace("_image", "").replace("_", "-") for n in given)
            raise TaskError(f"--task already says it all: leave out {flags}")

    def _spec(self, source: str) -> TaskFile:
        start: tuple[float, ...] | None = self.start
        goal, radius = self.goal, self.robot_radius
        if self.metres:
            from tdac_envs.source2d import metres_to_pixels

            start, goal, radius = metres_to_pixels(source, self.start, goal, radius)
        if start is not None and self.heading is not None:
            start = (*start, self.heading)
        return TaskFile.model_validate(
            {
                "map": source,
                "start": start,
                "goal": goal,
                "snap": self.snap,
                "robot": RobotSpec(radius=radius, image=self.robot_image),
                "instructions": _text(self.instructions),
            }
        )


def _text(given: str | None) -> str:
    """The user's instructions: the text itself, or the contents of a file."""
    if given is None:
        return ""
    path = Path(given)
    if len(given) < 250 and "\n" not in given and path.is_file():
        return path.read_text(encoding="utf-8", errors="replace")
    return given
