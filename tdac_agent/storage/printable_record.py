"""Base class of records with texts from controllers, models or files."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, model_validator

from tdac_agent.storage.plain import printable


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
    """An immutable one without unknown fields."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def _filtered(value: Any) -> Any:
    if type(value) is str:
        return printable(value)
    if type(value) is dict:
        return {_filtered(key): _filtered(item) for key, item in value.items()}
    if type(value) in (list, tuple):
        return type(value)(map(_filtered, value))
    return value
