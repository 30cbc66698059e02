"""What a user asks for with `movers=...`: models of each kind of mover.

Lengths are px, speeds px/s, angles rad; points are (x, y) on the map.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    Field,
    ValidationError,
    model_validator,
)

from tdac_envs.core.arguments import LARGEST, SMALLEST, in_radians
from tdac_envs.core.errors import TaskError, first_problem, hint
from tdac_envs.core.strict_model import StrictModel

MOST_MOVERS = 256
"""Largest number of movers of a robot."""
MOST_PEOPLE = 64
"""Largest number of people in the crowds of a robot."""
MOST_POINTS = 1000
"""Largest number of waypoints of a route."""

Coordinate = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Point = tuple[Coordinate, Coordinate]
Heading = Annotated[float, AfterValidator(in_radians)]
Length = Annotated[float, Field(ge=SMALLEST, le=LARGEST)]
Speed = Annotated[float, Field(ge=0.0, le=LARGEST)]


class _MoverSpec(StrictModel):
    speed: Speed | None = Field(
        None, description="px/s. Default: half of the robot's largest wheel speed."
    )
    radius: Length | None = Field(
        None, description="Radius of the disc, px. Default: that of the robot."
    )


class RouteSpec(_MoverSpec):
    """A disc that drives along waypoints for ever, and passes through other movers."""

    kind: Literal["route"] = "route"
    points: tuple[Point, ...] = Field(
        min_length=1,
        max_length=MOST_POINTS,
        description="Waypoints, px. With a single one, the disc stands still there.",
    )
    loop: bool = Field(
        True,
        description="Whether it drives from the last waypoint to the first; otherwise "
        "it goes back and forth.",
    )
    phase: Annotated[float, Field(ge=0.0, lt=1.0)] | None = Field(
        None,
        description="Where it starts, as a fraction of the length of the whole route, "
        "there and back if not `loop`. Default: drawn at each reset.",
    )

    @model_validator(mode="after")
    def _goes_on(self) -> RouteSpec:
        ends = [*self.points, self.points[0]] if self.loop else self.points
        for k in range(len(ends) - 1 if len(self.points) > 1 else 0):
            if ends[k] == ends[k + 1]:
                raise ValueError(f"segment {k} of the route has no length")
        return self

    @property
    def number(self) -> int:
        """Number of discs."""
        return 1


class BounceSpec(_MoverSpec):
    """Discs that drive straight, bounce off walls, and pass through other movers."""

    kind: Literal["bounce"] = "bounce"
    count: int = Field(1, ge=1, description="Number of discs.")
    start: Point | None = Field(
        None, description="Where it starts, px. Default: drawn at each reset."
    )
    heading: Heading | None = Field(
        None, description="Its direction at first, rad. Default: drawn at each reset."
    )

    @model_validator(mode="after")
    def _has_one_start(self) -> BounceSpec:
        if self.start is not None and self.count > 1:
            raise ValueError("start is for a single mover: leave out count, or start")
        return self

    @property
    def number(self) -> int:
        """Number of discs."""
        return self.count


class CrowdSpec(_MoverSpec):
    """People who walk to places of their own and avoid each other (ORCA)."""

    kind: Literal["crowd"] = "crowd"
    count: int = Field(1, ge=1, le=MOST_PEOPLE, description="Number of people.")
    sees_robot: bool | None = Field(
        None,
        description="Whether they make way for the robot. Default: half of them do, "
        "drawn at each reset.",
    )

    @property
    def number(self) -> int:
        """Number of discs."""
        return self.count


Spec = Annotated[RouteSpec | BounceSpec | CrowdSpec, Field(discriminator="kind")]
"""Any entry of `movers`, for the models of files."""
MoversOption = str | Sequence[Mapping[str, Any]] | None
"""The argument `movers` of an environment."""

AnySpec = RouteSpec | BounceSpec | CrowdSpec
KINDS: dict[str, type[AnySpec]] = {
    "route": RouteSpec,
    "bounce": BounceSpec,
    "crowd": CrowdSpec,
}
_EXAMPLE = "'bounce:5' or [{'kind': 'bounce', 'count': 5}]"


def read_specs(given: MoversOption) -> tuple[AnySpec, ...]:
    """The movers that a user asks for.

    Args:
        given: A list with a dict for each mover or group of movers; a text
            `"KIND:COUNT"` with the defaults of a kind; or None.

    Raises:
        TaskError: An entry is not valid, or there are too many movers.
    """
    if given is None:
        return ()
    if isinstance(given, str):
        given = [_from_text(given)]
    if not isinstance(given, list | tuple):
        raise TaskError(f"movers: expected {_EXAMPLE}, got {given!r:.100}")
    _check_number(len(given))
    specs = tuple(_checked(each, f"movers: entry {i}") for i, each in enumerate(given))
    _check_number(sum(spec.number for spec in specs))
    people = sum(spec.number for spec in specs if isinstance(spec, CrowdSpec))
    if people > MOST_PEOPLE:
        raise TaskError(
            f"movers: expected crowds of at most {MOST_PEOPLE} people, got {people}"
        )
    return specs


def _check_number(count: int) -> None:
    if count > MOST_MOVERS:
        raise TaskError(f"movers: expected at most {MOST_MOVERS}, got {count}")


def _from_text(text: str) -> dict[str, Any]:
    """The entry of a text `"KIND:COUNT"`."""
    kind, _, count = text.partition(":")
    if kind not in KINDS:
        raise TaskError(
            f"movers: unknown kind {kind!r}{hint(kind, KINDS)}; expected one of "
            f"{', '.join(KINDS)}, such as {_EXAMPLE}"
        )
    if "count" not in KINDS[kind].model_fields:
        raise TaskError(
            f"movers: a {kind} needs more than a number; expected a list such as "
            "[{'kind': 'route', 'points': [[40, 40], [90, 40]], 'speed': 30}]"
        )
    if not count.isascii() or not count.isdigit() or len(count) > 12:
        raise TaskError(
            "movers: expected a kind and how many there are, such as "
            f"'{kind}:5', got {text!r:.100}"
        )
    _check_number(int(count))
    return {"kind": kind, "count": int(count)}


def _checked(entry: Any, name: str) -> AnySpec:
    if not isinstance(entry, Mapping):
        raise TaskError(f"{name}: expected a dict, got {entry!r:.100}")
    kind = entry.get("kind")
    if not isinstance(kind, str) or kind not in KINDS:
        got = f", got {kind!r:.100}{hint(str(kind), KINDS)}" if kind else ""
        raise TaskError(f"{name}: kind: expected one of {', '.join(KINDS)}{got}")
    count = entry.get("count")
    if isinstance(count, int):
        _check_number(count)
    try:
        return KINDS[kind].model_validate(dict(entry))
    except ValidationError as error:
        problem = first_problem(error, KINDS[kind])
        raise TaskError(f"{name}: {problem}") from None
