"""Robot files that somebody else offers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml
from offered_maps import draw, link, pipe, ros, text
from offers import Maker, Offer

SHOW = ("robots", "show", "robot.yaml")
ENDS = ("--metres", "--start", "2", "2", "--goal", "5", "2", "--dry-run")
DRIVE = ("synth", "--map", "map.yaml", *ENDS, "--robot", "robot.yaml")
TASK = ("synth", "--task", "task.yaml", "--dry-run")
SET = ("synth", "--set", "set.yaml", "--dry-run")
GOOD: dict[str, Any] = {
    "schema": 1,
    "radius": 0.2,
    "axle_length": 0.3,
    "limits": {"max_wheel_speed": 0.5},
    "scanner": {
        "rays": 90,
        "first_angle": 0,
        "direction": "clockwise",
        "range_max": 4.0,
    },
    "pose": {"source": "AMCL"},
    "control_rate": 10,
    "stopping_distance": 0.05,
}
FIGURES = (
    *("radius", "axle_length", "limits.max_wheel_speed", "scanner.rays"),
    *("scanner.first_angle", "scanner.direction", "scanner.range_max"),
    *("pose.source", "control_rate", "stopping_distance"),
)


def robot(part: str = "", **changes: Any) -> Maker:
    """A robot file with some fields, of a part of it if one is named, otherwise."""
    own = GOOD | ({part: GOOD[part] | changes} if part else changes)
    new = [f"{part}.{key}" if part else key for key in changes]
    sources = dict.fromkeys((*FIGURES, *new), "assumed")
    unsourced = "name", "description", "drives", "units", "sources", "schema"
    known = {key: value for key, value in sources.items() if key not in unsourced}
    return text("robot.yaml", yaml.safe_dump({"sources": known, **own}))


def driven(make: Maker) -> Maker:
    """A robot file beside a map with a resolution."""
    return _both(ros(), make)


def named(robot: object, make: Maker) -> Maker:
    """A task in metres that names a robot."""
    task = {"map": "map.yaml", "frame": "metres", "start": [2, 2], "goal": [5, 2]}
    content = yaml.safe_dump({**task, "robot": robot})
    return _both(driven(make), text("task.yaml", content))


def of_set(resolution: object, make: Maker) -> Maker:
    """A task set that names a robot."""
    own = {"worlds": [{"name": "aisles"}], "robot": "robot.yaml"}
    content = yaml.safe_dump({**own, "resolution": resolution})
    return _both(make, text("set.yaml", content))


def _both(first: Maker, second: Maker) -> Maker:
    def make(here: Path) -> None:
        first(here)
        second(here)

    return make


def _folder(here: Path) -> None:
    draw(here)
    (here / "robot.yaml").mkdir()


def _large(here: Path) -> None:
    with (here / "robot.yaml").open("wb") as file:
        file.truncate(3_000_000_000)


_LAUGHS = "".join(
    f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10) if n else 'x'}]\n" for n in range(10)
)
_OS = "!!python/object/apply:os.system [true]"


def _offer(
    name: str,
    make: Maker,
    says: str,
    words: tuple[str, ...] = SHOW,
    endless: bool = False,
) -> Offer:
    return Offer("robots", name, words, make, says, endless=endless)


OFFERS = [
    _offer("endless", link("robot.yaml", "/dev/zero"), "not a regular", endless=True),
    _offer("pipe", pipe("robot.yaml"), "not a regular file", endless=True),
    _offer("loop", link("robot.yaml", "robot.yaml"), "symbolic links"),
    _offer("other_file", link("robot.yaml", "/etc/passwd"), "expected keys|YAML"),
    _offer("folder", _folder, "Is a directory"),
    _offer("large", _large, "larger than 1 MB", endless=True),
    _offer("binary", text("robot.yaml", b"\xff\xfe\0"), "not valid YAML"),
    _offer("deep", text("robot.yaml", "[" * 3000), "nested deeper than 64 levels"),
    _offer("laughs", text("robot.yaml", _LAUGHS), "more than 20000 values"),
    _offer("code", text("robot.yaml", f"name: {_OS}"), "not valid YAML"),
    _offer("list", text("robot.yaml", "- 1"), "expected keys with values"),
    _offer("nan", robot(radius=float("nan")), "nan is not a finite number"),
    _offer("infinite", robot(radius=float("inf")), "inf is not a finite number"),
    _offer("vast", robot(radius=1e308), "radius: expected at most"),
    _offer("negative", robot(radius=-1), "radius: expected more than 0"),
    _offer("nan_angle", robot("scanner", first_angle=float("nan")), "finite number"),
    _offer("wound_up", robot("scanner", first_angle=721), "first_angle: .* at most"),
    _offer("no_rays", robot("scanner", rays=0), "rays: expected at least 1"),
    _offer("million_rays", robot("scanner", rays=10**6), "rays: expected at most 4096"),
    _offer("blind", robot("scanner", range_min=4.0), "range_min below range_max"),
    _offer("slow", robot(control_rate=1e-300), "control_rate: expected more than 0"),
    _offer("climbs", robot(name="../../x"), "name: "),
    _offer("escape", robot(name="a\x1b[2Jverified"), "name: "),
    _offer("markup", robot(name="[red]x[/]"), "name: "),
    _offer("long_name", robot(name="a" * 61), "at most 60 characters"),
    _offer("unknown_key", robot(radios=1), "did you mean 'radius'"),
    _offer("no_source", robot(sources={}), "no source of radius"),
    _offer("schema", robot(schema=2), "schema: "),
    _offer("wide", driven(robot(radius=1e9)), r"robot \(lengths in px\)", DRIVE),
    _offer(
        "far_offset",
        driven(robot("scanner", offset=[1e300, 0.0])),
        r"robot \(lengths in px\): scanner_offset",
        DRIVE,
    ),
    _offer("late", driven(robot("pose", latency=1e9)), "pose delay", DRIVE),
    _offer("hasty", driven(robot(control_rate=1e9)), "horizon of at most", DRIVE),
    _offer("in_pixels", driven(robot(units="pixels")), "is in pixels", DRIVE),
    _offer("of_task", named("robot.yaml", robot(radius=-1)), "more than 0", TASK),
    _offer(
        "typed_too_far",
        named({"radius": 0.2, "range_max": 1e9}, robot()),
        r"robot \(lengths in px\): range_max",
        TASK,
    ),
    _offer(
        "pipe_of_task",
        named("robot.yaml", pipe("robot.yaml")),
        "not a regular file",
        TASK,
        endless=True,
    ),
    _offer("of_set", of_set(0.05, robot(radius=-1)), "robot: .* more than 0", SET),
    _offer("set_of_points", of_set(0, robot()), "resolution above 0", SET),
    _offer("set_of_lists", of_set([1], robot()), "resolution to be a finite", SET),
    _offer(
        "set_without_end",
        of_set(0.05, link("robot.yaml", "/dev/zero")),
        "not a regular file",
        SET,
        endless=True,
    ),
]
