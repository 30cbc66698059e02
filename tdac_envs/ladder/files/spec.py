"""The key `worlds` of a `set.yaml` whose worlds come from files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from tdac_envs.core.strict_model import StrictModel

FileSplit = Literal["train", "dev", "test"]
"""Splits that worlds from files may have."""
AnySplit = Literal[FileSplit, "hidden"]
"""These, and the split of a folder of held-out maps."""
FILE_SPLITS: tuple[FileSplit, ...] = ("train", "dev", "test")


def _each_once(splits: tuple[FileSplit, ...]) -> tuple[FileSplit, ...]:
    if len(set(splits)) < len(splits):
        raise ValueError("expected each split once")
    return tuple(split for split in FILE_SPLITS if split in splits)


class FilesSpec(StrictModel):
    """Where the worlds are: either `folder` or `barn`."""

    folder: Path | None = Field(
        None, description="Folder of maps; its index.json lists their tasks."
    )
    barn: Path | None = Field(None, description="JSON file with worlds of BARN.")
    resolution: float = Field(
        0.025, ge=0.001, le=1, description="Metres per px, for BARN."
    )
    metres: float | None = Field(
        None, gt=0, description="Metres per px, if the index is in metres."
    )
    splits: Annotated[tuple[FileSplit, ...], AfterValidator(_each_once)] = Field(
        FILE_SPLITS, min_length=1, description="Splits that share the worlds."
    )
    tests: tuple[str, ...] = Field(
        (), description="Names of the worlds of `test`; the others are for the rest."
    )
    runs: int = Field(
        1, ge=1, le=1000, description="Episodes of each world, which differ in noise."
    )
    infeasible: Literal["refuse", "skip"] = Field(
        "refuse", description="What happens if a task is not feasible."
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.folder is None) == (self.barn is None):
            raise ValueError("expected either `folder` or `barn`")
        if self.tests and self.splits != FILE_SPLITS:
            raise ValueError("`tests` needs the splits train, dev and test")
        return self

    @property
    def path(self) -> Path:
        """The folder, or the file of BARN."""
        path = self.folder or self.barn
        assert path is not None
        return path
