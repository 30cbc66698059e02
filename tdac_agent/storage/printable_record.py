"""Base class of records with texts from controllers, models or files."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, model_validator

from tdac_agent.storage.files import read_inside
from tdac_agent.storage.plain import printable
from tdac_envs.core.intake import RECORD_BYTES, parse_json

R = TypeVar("R", bound=BaseModel)


class PrintableRecord(BaseModel):
    """A record whose texts can be written and printed, whatever their origin.

    A single lone surrogate would otherwise make the whole record unwritable.
    """

    @model_validator(mode="before")
    @classmethod
    def _filter(cls, values: Any) -> Any:
        return _filtered(values)

    def __setattr__(self, name: str, value: Any) -> None:
        super().__setattr__(name, _filtered(value))


class StrictRecord(PrintableRecord):
    """A record that nothing changes, with no other fields than its own."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def load_record(form: type[R], folder: Path, name: str) -> R:
    """The record in a JSON file of a folder.

    Args:
        form: Type of the record.
        folder: The folder.
        name: The file, relative to it.

    Raises:
        OSError: It cannot be read, or a link leads out of the folder.
        ValueError: It is not such a record.
    """
    return form.model_validate(parse_json(read_inside(folder, name, RECORD_BYTES)))


def read_record(form: type[R], folder: Path, name: str) -> R | None:
    """Like `load_record`; None if there is no readable record."""
    try:
        return load_record(form, folder, name)
    except (OSError, ValueError):
        return None


def _filtered(value: Any) -> Any:
    if type(value) is str:
        return printable(value)
    if type(value) is dict:
        return {_filtered(key): _filtered(item) for key, item in value.items()}
    if type(value) in (list, tuple):
        return type(value)(map(_filtered, value))
    return value
