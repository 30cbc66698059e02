"""The task or the task set that the flags of a command name."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import Field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tdac_agent.cli.task_changes import (
    changed_task,
    file_of,
    keys_of,
    refuse_foreign,
    shown,
)
from tdac_agent.cli.task_flags import TaskFlags
from tdac_agent.option_fields import flag_name, flag_of, typed_fields
from tdac_agent.runs.ownership import load_set_problem, load_task
from tdac_agent.sandbox import TIERS
from tdac_agent.tasks.registry import environment_with_key
from tdac_agent.tasks.task import Task
from tdac_agent.tasks.task_file import (
    MAP_FILES,
    SET_FILE,
    TASK_FILE,
    Profile,
    bundled_tasks,
)
from tdac_envs.core.errors import TaskError, hint
from tdac_envs.core.intake import TEXT_BYTES, parse_yaml, read_file
from tdac_envs.map2d.source import check_exists, has_resolution
from tdac_envs.mapping.bundled import bundled_map, bundled_maps

if TYPE_CHECKING:
    from tdac_agent.problems.problem import Problem
    from tdac_envs.ladder.task_sets import TaskSet

NAMING = {
    "task": "--task",
    "map_image": "--map",
    "world": "--world",
    "set_name": "--set",
}
"""Fields that name a task or a task set, and their flags."""
IN_METRES = (
    "places and lengths are px; for metres, add --resolution METRES (per px) or give a "
    "ROS map.yaml"
)
"""Hint for a map without a resolution."""


def with_named_file(flags: TaskFlags) -> TaskFlags:
    """The flags, with the file that has no flag as that of its flag.

    Raises:
        TaskError: There is no such file, or a task or a task set is named as well.
    """
    check_frame(flags)
    if flags.file is None:
        return flags
    field = kind_of_file(flags.file)
    if field is None:
        from tdac_envs.ladder.set_file import shipped_names

        known = [*bundled_tasks(), *shipped_names()]
        raise TaskError(
            f"{flags.file!r} is no map, world, task.yaml or set.yaml"
            f"{hint(flags.file, known)}"
        )
    for other, flag in NAMING.items():
        if getattr(flags, other) is not None:
            raise TaskError(f"give {flags.file} or {flag}, not both")
    named: dict[str, Any] = {field: flags.file}
    return replace(flags, file=None, **named)


def kind_of_file(name: str) -> str | None:
    """The field of `TaskFlags` that a name without a flag is for; None for none."""
    if name in bundled_tasks():
        return "task"
    path = Path(name)
    if path.is_dir():
        names = {TASK_FILE: "task", SET_FILE: "set_name"}
        return next((names[each] for each in names if (path / each).is_file()), None)
    suffix = path.suffix.lower()
    if suffix in MAP_FILES:
        return "map_image"
    if suffix in (".yaml", ".yml"):
        return _kind_of_yaml(path)
    if suffix == ".wbt":
        return "world"
    from tdac_envs.ladder.set_file import shipped_names

    return "set_name" if name in shipped_names() else None


def _kind_of_yaml(path: Path) -> str:
    """A task set has a generator or files of worlds; a ROS map has a resolution."""
    try:
        data = parse_yaml(read_file(path, TEXT_BYTES))
    except (OSError, ValueError):
        return "task"  # whose loading says what is wrong
    keys = data.keys() if isinstance(data, dict) else set()
    if {"image", "resolution"} <= keys:
        return "map_image"
    return "set_name" if keys & {"worlds", "files"} else "task"


def check_scope(on_set: bool, flags: TaskFlags, *options: Any) -> None:
    """Refuses flags that only a single task has, or only a task set.

    Raises:
        TaskError: There is such a flag.
    """
    other = "task" if on_set else "set"
    wrong = [
        *(typed_fields(flags.changes) if on_set else []),
        *(
            field
            for each in options
            for field in typed_fields(each)
            if scope(field) == other
        ),
    ]
    names = [*map(flag_name, wrong), *["--metres"] * (on_set and flags.in_metres)]
    if on_set:
        others = {name: flag for name, flag in NAMING.items() if name != "set_name"}
        names = [f for n, f in others.items() if getattr(flags, n) is not None] + names
    if names and on_set:
        raise TaskError(f"--set brings its own tasks; leave out {names[0]}")
    if names:
        raise TaskError(f"{names[0]} needs --set NAME; tdac sets lists the task sets")


def scope(field: Field[Any]) -> str:
    """`task` or `set` if only a single task or a task set has the flag; else empty."""
    flag = flag_of(field)
    return flag.scope if flag else ""


def chosen(flags: TaskFlags, *options: Any) -> Task | TaskSet:
    """The task or the task set that the flags name, by default the task `maze`.

    Args:
        flags: The flags.
        options: Further options of the command, whose scope is checked.

    Raises:
        TaskError: Flags contradict each other, or it cannot be used.
    """
    flags = with_named_file(flags)
    check_scope(flags.set_name is not None, flags, *options)
    if flags.set_name is None:
        return chosen_task(flags)
    from tdac_envs.ladder.task_sets import load_set

    return load_set(flags.set_name)


def chosen_problem(
    flags: TaskFlags, *options: Any, profile: Profile | None = None
) -> Problem:
    """What the flags name; the tests that it brings may need a permission.

    Args:
        flags: The flags.
        options: Further options of the command, whose scope is checked.
        profile: The profile of a task.

    Raises:
        TaskError: Flags contradict each other, or it cannot be used.
    """
    flags = with_named_file(flags)
    check_scope(flags.set_name is not None, flags, *options)
    if flags.set_name is None:
        from tdac_agent.problems.single_task import TaskProblem  # slow to import

        return TaskProblem(chosen_task(flags).with_profile(profile))
    check_set_profile(profile)
    return load_set_problem(flags.set_name)


def check_set_profile(profile: str | None) -> None:
    """Refuses the profile `paper` on a task set.

    Raises:
        TaskError: It is wanted.
    """
    if profile == "paper":
        raise TaskError(
            "a task set has only the profile policy: the functions of the profile "
            "paper plan on the one map that a task has, and each world has its own; "
            "leave out --profile paper"
        )


def chosen_single(flags: TaskFlags) -> Task:
    """The task that the flags name, for a command without task sets.

    Raises:
        TaskError: They name a task set, or the task cannot be used.
    """
    named = with_named_file(flags)
    if named.set_name is not None:
        raise TaskError(f"{flags.file} is a task set; this command needs a single task")
    return chosen_task(named)


def chosen_task(flags: TaskFlags, default: str = "maze") -> Task:
    """The task that the flags describe.

    Raises:
        TaskError: The flags contradict each other, or the task cannot be used.
        MapError: There is no such map.
    """
    check_values(flags)
    if flags.task is not None:
        _refuse_naming("--task already defines the task", flags, ("map_image", "world"))
        return changed_task(load_task(flags.task), flags)
    if flags.world is not None:
        _refuse_naming("--world defines an e-puck task", flags, ("map_image",))
        entry = environment_with_key("world")
        refuse_foreign(flags, entry)
        keys = {"env": entry.id, "world": flags.world, **keys_of(flags)}
        return shown(load_task(file_of(keys), base=Path()), flags)
    refuse_foreign(flags, environment_with_key("map"))
    source = flags.map_image or default
    flags = in_own_units(flags, source)
    own = source not in bundled_maps()
    if own:
        check_exists(Path(source))
    if own and (flags.start is None or flags.goal is None):
        raise TaskError(
            f"the map {source!r} needs --start X Y and --goal X Y "
            f"({_rulers(Path(source), flags)})"
            + ("" if has_resolution(source, flags.resolution) else f"; {IN_METRES}")
        )
    if flags.in_metres and not own:
        raise TaskError("--metres needs a --map with a resolution, as in map.yaml")
    keys = keys_of(flags, start=None if own else bundled_map(source).start)
    frame = "metres" if flags.in_metres else "pixels"
    return load_task(file_of({"map": source, "frame": frame, **keys}), base=Path())


def in_own_units(flags: TaskFlags, source: str) -> TaskFlags:
    """The flags, in metres if their map has a resolution and they choose no units.

    Args:
        flags: The flags.
        source: The map.
    """
    chosen_ones = flags.metres or flags.frame is not None
    if chosen_ones or source in bundled_maps():
        return flags
    if not has_resolution(source, flags.resolution):
        return flags
    return replace(flags, frame="metres")


def _refuse_naming(why: str, flags: TaskFlags, names: Collection[str]) -> None:
    """Refuses a second flag that names a task.

    Raises:
        TaskError: There is one.
    """
    wrong = [NAMING[name] for name in names if getattr(flags, name) is not None]
    if wrong:
        raise TaskError(f"{why}: leave out {', '.join(wrong)}")


def check_frame(flags: TaskFlags) -> None:
    """Refuses `--metres` next to `--frame pixels`.

    Raises:
        TaskError: They contradict each other.
    """
    if flags.metres and flags.frame == "pixels":
        raise TaskError("--metres is --frame metres: leave out --frame pixels")


def check_values(flags: TaskFlags) -> None:
    """Refuses flags together or values that are certainly mistakes.

    Raises:
        TaskError: There are such flags.
    """
    check_frame(flags)
    check_heading(flags.heading)
    if flags.robot_radius is not None and not flags.robot_radius > 0:
        radius = flags.robot_radius
        raise TaskError(f"--robot-radius must be greater than 0, got {radius:g}")


def check_heading(heading: float | None) -> None:
    """Refuses degrees: a heading of more than a full turn.

    Raises:
        TaskError: The heading is larger than 2 pi.
    """
    if heading is not None and abs(heading) > 2.0 * math.pi + 1e-3:
        turn = math.remainder(math.radians(heading), 2.0 * math.pi)
        raise TaskError(
            f"--heading (the YAW of --start) is in radians, and {heading:g} is more "
            f"than a full turn: did you mean {turn:.4g} ({heading:g} degrees)?"
        )


def _rulers(map_file: Path, flags: TaskFlags) -> str:
    """Where to read places on a map."""
    scale = "" if flags.resolution is None else f" --resolution {flags.resolution:g}"
    units = ""
    if flags.in_metres != has_resolution(str(map_file), flags.resolution):
        units = " --metres" if flags.in_metres else " --frame pixels"
    return f"read them off the rulers that `tdac map IMAGE{scale}{units}` draws"


def check_tier(name: str) -> None:
    """Checks the name of a sandbox tier.

    Raises:
        TaskError: There is no such tier.
    """
    names = ("auto", *(tier.name for tier in TIERS))
    if name not in names:
        known = ", ".join(names)
        raise TaskError(f"unknown sandbox tier {name!r}; expected one of {known}")
