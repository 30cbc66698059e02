"""Deviations: one robot or world that differs from what its controller is told.

A disturbance (`tdac_agent.tasks.disturbance`) says how errors are drawn; a deviation is
one such error, of a known size. `tdac falsify` searches for the smallest one with which
a controller fails.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, Literal, NamedTuple

from tdac_envs.core.arguments import number_up_to
from tdac_envs.core.errors import TaskError, hint

Unit = Literal["radii", "rad", "share", "steps", "s"]
MOST = 3.0
"""Largest deviation of each part, in its sizes."""


class DeviationPart(NamedTuple):
    """A part of a deviation.

    Attributes:
        words: What it is, in words.
        size: Its usual size; deviations are measured in it.
        unit: Unit of sizes. Lengths are stated in body radii.
        signed: Whether it may be negative.
        most: Largest absolute value that makes sense.
        ranges: Whether it is for robots that measure ranges alone.
        own_world: Whether it is for single tasks alone.
    """

    words: str
    size: float
    unit: Unit
    signed: bool = True
    most: float = math.inf
    ranges: bool = False
    own_world: bool = False


DEVIATIONS = {
    "start_x": DeviationPart("start, x", 0.5, "radii", own_world=True),
    "start_y": DeviationPart("start, y", 0.5, "radii", own_world=True),
    "heading": DeviationPart("heading at the start", 0.25, "rad", own_world=True),
    "axle": DeviationPart("axle", 0.05, "share", most=0.9),
    "wheels": DeviationPart("unequal wheels", 0.02, "share", most=0.9),
    "range_scale": DeviationPart("scale of the readings", 0.05, "share", most=0.9),
    "range_bias": DeviationPart("bias of the ranges", 0.1, "radii", ranges=True),
    "pose_x": DeviationPart("pose error, x", 0.1, "radii"),
    "pose_y": DeviationPart("pose error, y", 0.1, "radii"),
    "pose_heading": DeviationPart("heading error", 0.05, "rad"),
    "delay": DeviationPart("delay", 1.0, "steps", signed=False),
    "slip": DeviationPart("slip", 0.05, "share", signed=False, most=1.0),
    "lag": DeviationPart("motor lag", 0.1, "s", signed=False),
    "obstacles_x": DeviationPart("obstacles, x", 0.1, "radii", own_world=True),
    "obstacles_y": DeviationPart("obstacles, y", 0.1, "radii", own_world=True),
}
"""All parts by their names, in the order in which reports list them."""
_SMALLEST_SIZE, _LARGEST_SIZE = 1e-4, 1000.0


@dataclass(frozen=True, slots=True)
class Deviation:
    """How a robot and its world differ from what the controller is told.

    0 is no difference. Lengths are in body radii; the x and y axes, and the sign of
    headings, are those of the environment.

    Attributes:
        start_x: Shift of the start.
        start_y: Likewise.
        heading: Turn of the heading at the start, rad.
        axle: Relative error of the axle length.
        wheels: Relative difference of the wheels' radii; the left one is larger if it
            is positive.
        range_scale: Relative error of all readings of the distance sensors.
        range_bias: What is added to all ranges.
        pose_x: Error of the observed pose.
        pose_y: Likewise.
        pose_heading: Error of the observed heading, rad.
        delay: Steps until an action takes effect.
        slip: Relative standard deviation of each wheel's speed in each step.
        lag: Time constant with which the wheels follow their commands, s.
        obstacles_x: Shift of all obstacles, on maps by whole pixels.
        obstacles_y: Likewise.
    """

    start_x: float = 0.0
    start_y: float = 0.0
    heading: float = 0.0
    axle: float = 0.0
    wheels: float = 0.0
    range_scale: float = 0.0
    range_bias: float = 0.0
    pose_x: float = 0.0
    pose_y: float = 0.0
    pose_heading: float = 0.0
    delay: int = 0
    slip: float = 0.0
    lag: float = 0.0
    obstacles_x: float = 0.0
    obstacles_y: float = 0.0

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not abs(value) <= _LARGEST_SIZE:  # not a number, either
                raise ValueError(f"{name}: {value!r:.20} is no deviation")

    @classmethod
    def of(cls, sizes: Mapping[str, float]) -> Deviation:
        """The deviation with these parts; a delay is rounded to whole steps."""
        own: dict[str, Any] = {name: float(value) for name, value in sizes.items()}
        whole = {n: round(v) for n, v in own.items() if DEVIATIONS[n].unit == "steps"}
        return cls(**own | whole)

    def parts(self) -> dict[str, float]:
        """The parts that are not 0."""
        return {name: value for name, value in asdict(self).items() if value}

    def without(self, name: str) -> Deviation:
        """The same without one of its parts."""
        return Deviation.of({k: v for k, v in self.parts().items() if k != name})

    def norm(self, space: Mapping[str, float]) -> float:
        """Its Euclidean length, each part measured in its size."""
        return math.hypot(*(v / space[name] for name, v in self.parts().items()))


assert [field.name for field in fields(Deviation)] == list(DEVIATIONS)


def space_of(
    chosen: Mapping[str, float | None] | None, *, ranges: bool, own_world: bool
) -> dict[str, float]:
    """The parts that are searched, with their sizes.

    Args:
        chosen: Parts to search alone, with other sizes than the usual ones; None for
            all parts.
        ranges: Whether the robot measures ranges.
        own_world: Whether the problem is a single task.

    Raises:
        TaskError: There is no such part here, a size is not valid, or none is left.
    """
    here = {
        name: part.size
        for name, part in DEVIATIONS.items()
        if (ranges or not part.ranges) and (own_world or not part.own_world)
    }
    if chosen is None:
        return here
    if not chosen:
        raise TaskError(f"no deviation to search: choose some of {', '.join(here)}")
    for name, size in chosen.items():
        if name not in DEVIATIONS:
            raise TaskError(
                f"unknown deviation {name!r}{hint(name, list(here))}; known: "
                f"{', '.join(here)}"
            )
        if name not in here:
            what = "robots with ranges" if not ranges else "single tasks"
            raise TaskError(f"{name} is for {what} alone; here: {', '.join(here)}")
        if size is not None:
            number_up_to(f"size of {name}", size, _LARGEST_SIZE)
            least = 1.0 if DEVIATIONS[name].unit == "steps" else _SMALLEST_SIZE
            if size < least:
                raise TaskError(
                    f"size of {name}: expected {least:g} or more, got {size:g}"
                )
    return {
        name: size if (own := chosen[name]) is None else float(own)
        for name, size in here.items()
        if name in chosen
    }


def limit_of(name: str, size: float) -> float:
    """Largest absolute value that is searched."""
    return min(MOST * size, DEVIATIONS[name].most)


def parsed(text: str) -> dict[str, float | None]:
    """Parts with values, or without, from words such as `delay=3,pose_x=0.1,axle`.

    Raises:
        TaskError: A value is not a number, or a part is given twice.
    """
    found: dict[str, float | None] = {}
    for word in filter(None, (each.strip() for each in text.split(","))):
        name, equals, value = word.partition("=")
        name = name.strip().replace("-", "_")
        if name in found:
            raise TaskError(f"deviation {name!r} is given twice")
        try:
            found[name] = float(value) if equals else None
        except ValueError:
            raise TaskError(
                f"deviation {name}: expected a number, got {value!r}"
            ) from None
    return found


def deviation_of(text: str) -> Deviation:
    """The deviation of words such as `delay=3,pose_x=0.1`; lengths in body radii.

    Raises:
        TaskError: There is no such part, or a value is missing or not valid.
    """
    own = parsed(text)
    if not own:
        raise TaskError(f"no deviation in {text!r}: expected words such as delay=3")
    for name, value in own.items():
        part = DEVIATIONS.get(name)
        if part is None:
            known = hint(name, list(DEVIATIONS))
            raise TaskError(
                f"unknown deviation {name!r}{known}; known: {', '.join(DEVIATIONS)}"
            )
        if value is None or not math.isfinite(value):
            raise TaskError(f"deviation {name}: expected {name}=NUMBER, a finite one")
        if value < 0 and not part.signed:
            raise TaskError(f"deviation {name}: expected 0 or more, got {value:g}")
        if abs(value) > min(part.most, _LARGEST_SIZE):
            most = min(part.most, _LARGEST_SIZE)
            raise TaskError(
                f"deviation {name}: expected at most {most:g}, got {value:g}"
            )
        if part.unit == "steps" and value != round(value):
            raise TaskError(f"deviation {name}: expected a whole number, got {value:g}")
    return Deviation.of({name: float(value or 0.0) for name, value in own.items()})


def words_of(deviation: Deviation) -> str:
    """The words of a deviation, as `deviation_of` reads them."""
    return ",".join(f"{name}={value:g}" for name, value in deviation.parts().items())
