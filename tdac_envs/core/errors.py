"""Errors that a user of the environments can cause, one type per cause."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

if TYPE_CHECKING:
    from pydantic import ValidationError
    from pydantic.fields import FieldInfo

MAX_QUOTED = 200
"""Largest number of characters that an error quotes from a file."""
LEAST_LIKENESS = 0.6
"""Of a known key that is suggested for an unknown one."""
_MOST_FILES = 10_000


class TdacError(Exception):
    """An input cannot be used; the message says why and what to do."""


class MapError(TdacError):
    """A map image, map file or occupancy grid cannot be used."""


class TaskError(TdacError):
    """A start, goal or robot does not make a feasible task on its map."""


class PicturedError(TaskError):
    """A map or a task on it is refused; pictures of the map show why.

    Attributes:
        name: Name of the map.
        pictures: Image, grid, parameters and units of each picture, by its name.
        folder: Folder for the pictures, set by the command line; None for the default.
    """

    def __init__(
        self, message: str, name: str = "", pictures: dict[str, Any] | None = None
    ) -> None:
        super().__init__(message)
        self.name = name
        self.pictures = pictures or {}
        self.folder: Path | None = None


class PolarityError(PicturedError):
    """A map's obstacles may be dark or light: the user must choose."""


class RefusedError(PicturedError):
    """A start, goal or robot does not make a feasible task; a picture shows where."""


class WorldError(TdacError):
    """A Webots world cannot be used."""


class WorldFileError(WorldError):
    """A `.wbt` file is broken; the message begins with file, line and column."""


def first_problem(error: ValidationError, form: Any = None) -> str:
    """The first problem of a validation error, as `path.to.key: problem`.

    Unknown keys are reported before missing ones: a misspelt key causes both.

    Args:
        error: Error of a pydantic model.
        form: The model, or another type that was validated. With it, the known keys
            follow an unknown one, and the description of a key follows a wrong value.
    """
    problems = error.errors(include_url=False)
    unknown = (p for p in problems if p["type"] == "extra_forbidden")
    first = next(unknown, problems[0])
    place = ".".join(map(str, first["loc"]))[:MAX_QUOTED]
    reason = _reason(first) + ("" if form is None else _advice(first, form))
    return f"{place}: {reason}" if place else reason


def _advice(problem: Any, form: Any) -> str:
    """The known keys, the nearest first, or the description of a key."""
    *above, key = problem["loc"] or ("",)
    fields = fields_at(form, above)
    if problem["type"] == "extra_forbidden":
        likeness = {name: _likeness(str(key), name, fields[name]) for name in fields}
        known = sorted(fields, key=lambda name: -likeness[name])
        near = [name for name in known[:1] if likeness[name] >= LEAST_LIKENESS]
        return _meant(near) + f"; known: {', '.join(known)}"
    about = fields[key].description if key in fields else None
    told = problem["type"] in ("missing", "value_error") or not about
    return "" if told else f" ({str(about).rstrip('.')})"


def fields_at(form: Any, place: Sequence[int | str]) -> dict[str, FieldInfo]:
    """The fields of the models at a place of a validated type, by their keys.

    Args:
        form: The type.
        place: Keys, indices and tags of unions that lead to it, as in an error.
    """
    models = _models_in(form)
    for part in place:
        tagged = [one for one in models if part in _literals_of(one)]
        if len(models) > 1 and tagged:
            models = tagged
        elif part in (fields := _fields_of(models)):
            models = _models_in(fields[str(part)].annotation)
    return _fields_of(models)


def _models_in(annotation: Any) -> list[Any]:
    if hasattr(annotation, "model_fields"):
        return [annotation]
    return [model for part in get_args(annotation) for model in _models_in(part)]


def _fields_of(models: Iterable[Any]) -> dict[str, FieldInfo]:
    """Fields by their keys in a file: the alias of a field, or else its name."""
    pairs = (pair for model in models for pair in model.model_fields.items())
    return {field.alias or name: field for name, field in pairs}


def _literals_of(model: Any) -> set[Any]:
    fields = model.model_fields.values()
    return {value for field in fields for value in get_args(field.annotation)}


def _likeness(typed: str, name: str, field: FieldInfo) -> float:
    """From 0 to 1; 1 also for the symbol with which the description begins."""
    import difflib

    symbol = (field.description or "").partition(" ")[0].rstrip(":,;")
    return (
        1.0 if symbol == typed else difflib.SequenceMatcher(None, typed, name).ratio()
    )


def _reason(problem: Any) -> str:
    """What is wrong, in the words of the other errors."""
    kind, limits = problem["type"], problem.get("ctx", {})
    if kind in _REASONS:
        return _REASONS[kind]
    if kind == "union_tag_invalid":
        tag, known = limits["tag"], limits["expected_tags"]
        name = limits["discriminator"].strip("'")
        return f"unknown {name} '{tag:.60}'; expected one of {known}"
    if kind in _LIMITS:
        key, text = _LIMITS[kind]
        if key == "ge" and 0.0 < limits[key] < 1e-6:
            text, limits = "more than", {key: 0}
        return f"expected {text} {limits[key]:g}, got {problem['input']!r:.100}"
    if kind in _LENGTHS:
        key, text = _LENGTHS[kind]
        return f"expected {text} {limits[key]} of them, got {limits['actual_length']}"
    return str(problem["msg"]).removeprefix("Value error, ")


def one_line_reason(error: Exception, form: Any = None) -> str:
    """One-line reason for not using a file: the OS error or the first problem.

    Args:
        error: The error.
        form: As for `first_problem`.
    """
    from pydantic import ValidationError

    if isinstance(error, ValidationError):
        return first_problem(error, form)
    reason = error.strerror if isinstance(error, OSError) else error
    beside = ""
    if isinstance(error, FileNotFoundError) and error.filename is not None:
        beside = file_hint(error.filename)
    return " ".join(str(reason).split())[:MAX_QUOTED] + beside


def hint(typed: str, known: Iterable[str]) -> str:
    """The suffix " (did you mean 'NAME'?)"; empty if no known name is similar."""
    meant = nearest(typed, known)
    return _meant([meant] if meant else [])


def _meant(names: Sequence[str]) -> str:
    return f" (did you mean {names[0]!r}?)" if names else ""


def offer(name: str, place: str, which: str, problem: str) -> str:
    """What to do about a start or goal that cannot be used, then why it cannot.

    Args:
        name: `start` or `goal`.
        place: A place that can be used.
        which: Describes this place.
        problem: What is wrong, with the place that was given.
    """
    return f"move the {name} to {place}, {which}: {problem}"


def file_hint(path: str | Path) -> str:
    """The suffix " (did you mean 'PATH'?)" for a file that does not exist.

    It names the file in the same folder with the most similar name and the same suffix,
    or with the same name and another suffix; empty if there is none.
    """
    wanted = Path(path)
    try:
        names = [other.name for other in islice(wanted.parent.iterdir(), _MOST_FILES)]
    except (OSError, ValueError):
        return ""
    stems = {name.removesuffix(wanted.suffix): name for name in names}
    same = [stem for stem, name in stems.items() if stem != name]
    similar = stems.get(nearest(wanted.stem, same) or "")
    found = similar or next((n for n in names if Path(n).stem == wanted.stem), None)
    return f" (did you mean {str(wanted.with_name(found))!r}?)" if found else ""


def nearest(typed: str, known: Iterable[str]) -> str | None:
    """The known name most similar to what was typed, or None."""
    import difflib  # late, to keep the import of the environments fast

    return next(iter(difflib.get_close_matches(typed, list(known), n=1)), None)


_REASONS = {
    "extra_forbidden": "unknown key",
    "missing": "is missing",
    "model_type": "expected a mapping",
    "tuple_type": "expected a list",
}
_LIMITS = {
    "greater_than_equal": ("ge", "at least"),
    "greater_than": ("gt", "more than"),
    "less_than_equal": ("le", "at most"),
    "less_than": ("lt", "less than"),
}
_LENGTHS = {
    "too_short": ("min_length", "at least"),
    "too_long": ("max_length", "at most"),
}
