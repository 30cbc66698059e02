"""Errors that a user of the environments can cause, one type per cause."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pydantic import ValidationError


class TdacError(Exception):
    """Something the user gave cannot be used; the message says what and what to do."""


class MapError(TdacError):
    """A map image, map file or occupancy grid cannot be used."""


class TaskError(TdacError):
    """A start, goal or robot does not make a feasible task on its map."""


class WorldError(TdacError):
    """A Webots world cannot be used."""


class WorldFileError(WorldError):
    """A `.wbt` file is broken; the message begins with file, line and column."""


def first_problem(error: ValidationError) -> str:
    """The first thing that a model refuses: `place.in.it: what is wrong`."""
    first = error.errors(include_url=False)[0]
    place = ".".join(map(str, first["loc"]))
    reason = first["msg"].removeprefix("Value error, ")
    return f"{place}: {reason}" if place else reason
