"""`falsify.json`: what a policy survives, and the smallest failure that was found."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, ConfigDict, Field

from tdac_agent.runs.deviation_text import part_text, value_text
from tdac_agent.storage.printable_record import StrictRecord, load_record
from tdac_agent.tasks.deviation import DEVIATIONS, Deviation
from tdac_agent.tasks.units import Frame, Place, Units, units_in
from tdac_agent.verification.judge.episode_row import EpisodeRow

RECORD_FILE, PICTURE = "falsify.json", "counterexample.png"


def _known(part: str) -> str:
    if part not in DEVIATIONS:
        raise ValueError(f"there is no deviation {part!r:.40}")
    return part


PartName = Annotated[str, AfterValidator(_known)]
Size = Annotated[float, Field(gt=0.0)]


class FiniteRecord(StrictRecord):
    """A record without infinite numbers."""

    model_config = ConfigDict(allow_inf_nan=False)


class Direction(FiniteRecord):
    """A part of a deviation, alone, in one direction."""

    part: PartName
    sign: int
    survives: float = Field(description="Largest value that was survived, from 0 on.")
    fails: float | None = Field(
        None, description="Smallest value that failed; None up to the limit."
    )
    limit: float = Field(
        description="Largest value that was tried, or would have been."
    )
    impossible: bool = Field(
        False, description="Whether the next larger value leaves no feasible episode."
    )
    cause: str | None = Field(None, description="Cause of the smallest failure.")


class Counterexample(FiniteRecord):
    """The smallest failure that was found."""

    number: int = Field(description="Seed of the task, or number of the world.")
    deviation: Deviation
    norm: float = Field(description="Its length, each part in its size.")
    found_by: str = Field(description="`single`, `search`, or `none` without any.")
    row: EpisodeRow = Field(description="The failed episode.")


class Point(FiniteRecord):
    """Success at one value of one part, over jittered starts."""

    part: PartName
    value: float
    count: int = Field(ge=1)
    successes: int = Field(ge=0)


class Envelope(FiniteRecord):
    """What a policy survives in one world.

    Attributes:
        base: The episode without any deviation.
    """

    number: int = Field(description="Seed of the task, or number of the world.")
    base: EpisodeRow
    directions: tuple[Direction, ...] = ()
    counterexample: Counterexample | None = None
    episodes: int = Field(0, description="Episodes that were driven for it.")


class Falsification(FiniteRecord):
    """A search for the smallest failure, and no proof that there is no smaller one."""

    schema_version: int = 1
    name: str = Field(description="Name of the task or the task set.")
    sha256: str = Field(description="Its hash.")
    dynamics: str
    policy: str
    policy_sha256: str
    split: str | None = None
    unit: Place = "px"
    frame: Frame | None = None
    radius: Size = Field(description="Body radius, px or m.")
    dt: Size = Field(description="Duration of a step, s.")
    space: dict[PartName, Size] = Field(
        description="Parts that were searched, and sizes."
    )
    seed: int
    physics: str = Field("exact", description="What moved the robot.")
    budget: int = Field(description="Most episodes of the search.")
    episodes: int = Field(description="Episodes of the search, without curves.")
    sandbox: str
    envelopes: tuple[Envelope, ...] = Field(min_length=1)
    curves: tuple[Point, ...] = ()
    versions: dict[str, str]

    @property
    def units(self) -> Units:
        """Units in which figures are printed."""
        return units_in(self.unit, self.frame)

    @property
    def counterexample(self) -> Counterexample | None:
        """The smallest failure in any of the worlds."""
        found = [e.counterexample for e in self.envelopes if e.counterexample]
        return min(found, key=lambda each: each.norm, default=None)

    @property
    def fails_plainly(self) -> bool:
        """Whether a world is failed without any deviation."""
        return any(not each.base.success for each in self.envelopes)

    def value(self, part: str, value: float) -> str:
        """A value of a part with its unit."""
        return value_text(part, value, self.units, self.radius)

    def in_words(self, deviation: Deviation) -> str:
        """A deviation in words: `delay 3 steps with pose error, x +5 mm`."""
        own = deviation.parts().items()
        texts = [part_text(name, v, self.units, self.radius) for name, v in own]
        return " with ".join(texts) or "no deviation"


def read_falsification(folder: Path) -> Falsification | None:
    """The record in a folder; None if there is none that can be read."""
    try:
        return load_falsification(folder)
    except (OSError, ValueError):
        return None


def load_falsification(folder: Path) -> Falsification:
    """The record in a folder.

    Raises:
        OSError: There is none, it cannot be read, or a link leads out of the folder.
        ValueError: It is damaged.
    """
    return load_record(Falsification, folder, RECORD_FILE)
