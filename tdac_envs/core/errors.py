"""Errors that a user of the environments can cause, one type per cause."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pydantic import ValidationError

LONGEST = 200
"""Characters that are quoted from a file, at most."""


class TdacError(Exception):
    """Something the user gave cannot be used; the message says what and what to do."""


class MapError(TdacError):
    """A map image, map file or occupancy grid cannot be used."""


class TaskError(TdacError):
    """A start, goal or robot does not make a feasible task on its map."""


class PolarityError(TaskError):
    """Dark or light obstacles: both are likely, and only the user can tell.

    Attributes:
        name: Of the map.
        pictures: By polarity, what shows it: colours, grid and parameters.
        folder: Where the command line writes both previews, if it is asked for.
    """

    def __init__(
        self, message: str, name: str = "", pictures: dict[str, Any] | None = None
    ) -> None:
        super().__init__(message)
        self.name = name
        self.pictures = pictures or {}
        self.folder: Path | None = None


class WorldError(TdacError):
    """A Webots world cannot be used."""


class WorldFileError(WorldError):
    """A `.wbt` file is broken; the message begins with file, line and column."""


def first_problem(error: ValidationError, known: Iterable[str] = ()) -> str:
    """The first thing that a model refuses: `place.in.it: what is wrong`.

    A key that it does not know comes first: another one may be missing for that.

    Args:
        error: The refusal.
        known: The model's keys, one of which may be meant.
    """
    problems = error.errors(include_url=False)
    unknown = (p for p in problems if p["type"] == "extra_forbidden")
    first = next(unknown, problems[0])
    place = ".".join(map(str, first["loc"]))[:LONGEST]
    reason = _PLAINLY.get(first["type"], first["msg"].removeprefix("Value error, "))
    if first["type"] == "extra_forbidden":
        reason += hint(place, known)
    return f"{place}: {reason}" if place else reason


def why(error: Exception) -> str:
    """Why a file cannot be used, in a line: it cannot be read, or says nonsense."""
    from pydantic import ValidationError

    if isinstance(error, ValidationError):
        return first_problem(error)
    told = error.strerror if isinstance(error, OSError) else error
    return " ".join(str(told).split())[:LONGEST]


def hint(typed: str, known: Iterable[str]) -> str:
    """In brackets, the name that may be meant; empty where none is like it."""
    meant = nearest(typed, known)
    return f" (did you mean {meant!r}?)" if meant else ""


def nearest(typed: str, known: Iterable[str]) -> str | None:
    """The one of some names that is most like what was typed, where one is."""
    import difflib  # not when the environments are imported

    return next(iter(difflib.get_close_matches(typed, list(known), n=1)), None)


_PLAINLY = {
    "extra_forbidden": "there is no such key",
    "missing": "is missing",
    "model_type": "expected keys with their values",
}
