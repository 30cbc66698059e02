"""The flags that name a task or a task set, and change its parts.

`tdac_agent.cli.task_choice` loads what they name.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal, Self

from tdac_agent.option_fields import option

TASK = "Bundled task (`maze`, `epuck`, …), task.yaml, or run folder"
MAP_FILE = "Map image, ROS map.yaml, MovingAI .map, .npy grid"
WORLD_FILE = "Webots .wbt file"
SET = "Task set (`tdac sets`) or set.yaml"
TASKS, SETS = "Task", "Worlds of a task set"
"""Headings of the help."""
ONLY_FOR_SYNTH = ("robot_image", "instructions")
"""Task flags that only `tdac synth` has."""


@dataclass(frozen=True, slots=True)
class TaskFlags:
    """The flags that name a task or a task set; see `tdac synth --help`."""

    file: str | None = option(
        None,
        "File to drive on: a map, a Webots world, a task.yaml or a set.yaml; the same "
        "as --map, --world, --task or --set.",
        argument=True,
        metavar="FILE",
    )
    task: str | None = option(
        None, f"{TASK}.  [default: maze]", metavar="PATH", panel=TASKS
    )
    set_name: str | None = option(
        None, f"{SET}, instead of a task.", "--set", metavar="NAME", panel=TASKS
    )
    map_image: str | None = option(
        None, f"{MAP_FILE}, or bundled map.", "--map", metavar="PATH", panel=TASKS
    )
    world: str | None = option(
        None,
        f"{WORLD_FILE} with an e-puck, or bundled world.",
        metavar="PATH",
        panel=TASKS,
    )
    ignore: tuple[str, ...] = option(
        (),
        "Name or type of a world node to ignore although it may be solid; repeatable.",
        metavar="NAME",
        panel=TASKS,
    )
    start: tuple[float, float] | None = option(
        None,
        "Start: px on a map, m in a world and on a map with a resolution; also as X,Y; "
        "for YAW, see --heading.",
        metavar="X Y [YAW]",
        panel=TASKS,
    )
    goal: tuple[float, float] | None = option(
        None, "Goal, in the units of --start.", metavar="X Y", panel=TASKS
    )
    heading: float | None = option(
        None,
        "Start heading, rad, from +x towards +y (down in pixels, up in metres).",
        metavar="YAW",
        panel=TASKS,
    )
    tolerance: float | None = option(
        None,
        "Distance at which the goal counts as reached, in the units of --start.  "
        "[default: 20 px, less on a short path; with a resolution, the body radius; "
        "in a world 0.02 m]",
        panel=TASKS,
    )
    robot: str | None = option(
        None,
        "Robot (`tdac robots`) or robot file: its body, limits, scanner and control "
        "rate; its noise and latency disturb `--robust`.",
        metavar="NAME|FILE",
        panel=TASKS,
    )
    robot_radius: float | None = option(
        None,
        "Body radius, px, or m on a map with a resolution, which needs it.  "
        "[default: 15 px]",
        "--robot-radius",
        "--radius",
        panel=TASKS,
    )
    max_speed: float | None = option(
        None,
        "Full speed of a wheel, px/s or m/s.  [default: 75.59 px/s, or 0.5 m/s]",
        panel=TASKS,
    )
    rays: int | None = option(
        None, "Number of range rays.  [default: 18]", least=1, panel=TASKS
    )
    fov: float | None = option(
        None, "Angle of the fan of rays, degrees.  [default: 110]", panel=TASKS
    )
    range_max: float | None = option(
        None,
        "Largest range of a ray, px or m.  [default: 220 px, or 3.5 m]",
        "--range",
        panel=TASKS,
    )
    robot_image: Path | None = option(
        None, "Picture of the robot, nose to the right.", metavar="FILE", panel=TASKS
    )
    movers: str | None = option(
        None,
        "Moving obstacles on a map: `bounce:5` or `crowd:20`; a task.yaml can describe "
        "them in detail.  [default: none]",
        metavar="KIND:COUNT",
        panel=TASKS,
    )
    dt: float | None = option(
        None,
        "Duration of a step, s.  [default: 0.05, or the world's basicTimeStep]",
        panel=TASKS,
    )
    snap: bool = option(
        False,
        "Move a start or goal that is not free to the nearest free place from which "
        "the other one can be reached.",
        panel=TASKS,
    )
    frame: Literal["pixels", "metres"] | None = option(
        None,
        "Units of places, lengths and headings, given and printed, and of what a "
        "controller observes: pixels (y down), or metres in the map's frame as in ROS "
        "(map.yaml; y up). The controllers of an existing run or task keep theirs.  "
        "[default: metres on a map with a resolution, else pixels]",
        panel=TASKS,
    )
    metres: bool = option(False, "The same as --frame metres.", panel=TASKS)
    resolution: float | None = option(
        None,
        "Metres per pixel of a map image that gives none; places and lengths then are "
        "in metres.",
        panel=TASKS,
    )
    polarity: Literal["dark", "light"] | None = option(
        None,
        "Obstacle pixels of the map image: dark or light.  [default: detected]",
        panel=TASKS,
    )
    threshold: float | None = option(
        None,
        "Luminance above which a map pixel is light, from 0 to below 255.  "
        "[default: detected]",
        panel=TASKS,
    )
    instructions: str | None = option(
        None,
        "Additional instructions for the model: a text, or a file with it.",
        metavar="TEXT",
        panel=TASKS,
    )

    @property
    def in_metres(self) -> bool:
        """Whether the user gives and reads metres."""
        return self.metres or self.frame == "metres"

    @property
    def changes(self) -> Self:
        """Only the flags that change a task, not those that name one or its units."""
        own = ("file", "task", "map_image", "world", "set_name", "frame", "metres")
        rest: dict[str, Any] = {
            f.name: f.default for f in fields(self) if f.name in own
        }
        return replace(self, **rest)
