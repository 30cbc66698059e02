"""`report.json`: what was verified, how, and with which result."""

from __future__ import annotations

import re
from typing import Literal, Self

from pydantic import ConfigDict, Field, model_validator

from tdac_agent.storage.printable_record import StrictRecord
from tdac_agent.tasks.units import Place, Units
from tdac_agent.verification.diagnosis.gap import Gap, closest

Group = Literal["static", "unit", "end to end", "user", "judge"]
GROUPS: tuple[Group, ...] = ("static", "unit", "end to end", "user", "judge")
SHIPPED, OWN = "shipped", "own"
"""Names of the shipped suite and of a user's own suite."""
MAX_MESSAGE = 4000
"""Largest number of characters of a test's message."""
Cause = Literal[
    "collision",
    "no motion",
    "stuck",
    "spinning",
    "oscillating",
    "looping",
    "too slow",
    "missed goal",
    "wrong goal",
    "error",
    "time-out",
    "contract",
    "held out",
]


class Diagnosis(StrictRecord):
    """What happened in an episode, computed from its trajectory.

    Distances and positions are in px, for the e-puck in m; None if they do not apply.
    """

    cause: Cause
    text: str = Field(description="One paragraph; deterministic, without file paths.")
    shown: str | None = Field(
        None, exclude=True, description="The text in the user's units; not stored."
    )
    episode: str | None = Field(
        None, description="`nominal`, `jitter 1` … or `run_episode`."
    )
    step: int | None = Field(None, description="Step of the event.")
    x: float | None = Field(None, description="Position of the robot at that step.")
    y: float | None = None
    side: str | None = Field(None, description="Side of the body that was hit.")
    wall: tuple[float, float] | None = Field(None, description="Point of contact.")
    thing: str | None = Field(None, description="Name of the touched object.")
    corner: tuple[float, float] | None = Field(
        None, description="Corner of the wall within a body radius of the contact."
    )
    heading_error: float | None = Field(
        None, description="Angle to the shortest path at the end, rad, right positive."
    )
    saturated: float | None = Field(
        None, description="Share of steps with a wheel at its limit."
    )
    d0: float | None = Field(None, description="Remaining path at the start.")
    d_min: float | None = Field(None, description="Least remaining path.")


class Failure(StrictRecord):
    """One expected test that did not pass."""

    test: str = Field(description="Test id, as pytest prints it.")
    group: Group
    message: str = Field(description="Expected and actual result.")
    diagnosis: Diagnosis | None = None


class Episode(StrictRecord):
    """Figures of one judged episode; distances in px, for the e-puck in m."""

    # JSON has no infinity: a report with one could not be read back.
    model_config = ConfigDict(allow_inf_nan=False)

    name: str
    held_out: bool
    outcome: str
    steps: int
    collisions: int
    d0: float
    d_min: float
    d0_euclidean: float
    d_min_euclidean: float
    progress_passed: bool = Field(description="Progress test, by path length.")
    progress_passed_euclidean: bool
    call_ms_mean: float
    call_ms_p99: float
    error: str | None = None
    smallest_gap: Gap | None = Field(
        None, description="Smallest gap between body and obstacles, with its place."
    )

    @property
    def too_close(self) -> bool:
        """Whether it reached the goal, but came too close to an obstacle."""
        found, reached = self.smallest_gap, self.outcome == "reached"
        return reached and found is not None and found.too_close


class OtherEpisode(StrictRecord):
    """One episode that another physics drove again; lengths in px or m."""

    name: str
    outcome: str
    steps: int
    gap: float | None = Field(None, description="Smallest gap with this physics.")
    exact_gap: float | None = Field(None, description="Smallest gap of the judge's.")

    @property
    def arrives(self) -> bool:
        """Whether it reached the goal without a contact."""
        return self.outcome == "reached"


class SecondOpinion(StrictRecord):
    """The episodes that reached the goal, driven again with another physics.

    It informs: only `verify --require-physics` makes a test of it.
    """

    engine: str = Field(description="Name and version, such as `MuJoCo 4.0.0`.")
    scaled: bool = Field(
        False, description="Whether a map without metres got a body radius of 0.1 m."
    )
    varied: bool = Field(
        False, description="Whether the robot was varied in each episode."
    )
    measured: bool = Field(False, description="Whether it also measured the rays.")
    episodes: tuple[OtherEpisode, ...]

    @property
    def arrivals(self) -> int:
        """Number of episodes that reach the goal."""
        return sum(each.arrives for each in self.episodes)

    @property
    def agrees(self) -> bool:
        """Whether all of them reach the goal."""
        return self.arrivals == len(self.episodes)


class Provenance(StrictRecord):
    """What was verified, and under which conditions."""

    task: str
    called: str = Field("", description="Description of the task, beyond its name.")
    task_sha256: str
    dynamics: str = Field(
        "",
        description="Hash of all that decides what happens in an episode, code "
        "included; empty before Ladder 1.0.",
    )
    unit: Place = Field("px", description="Unit of positions and lengths.")
    left_out: tuple[str, ...] = Field(
        (), description="Nodes of the world that may be solid but were ignored."
    )
    map_sha256: str = Field(description="Hash of the map or world.")
    params_sha256: str
    sensors_sha256: str
    controller_sha256: str
    suite: str
    suite_sha256: str
    own_suite: str = Field("", description="Short hash of tests that are not shipped.")
    profile: Literal["policy", "paper"]
    paper: bool = Field(description="Nominal start only.")
    seed: int
    sandbox: str = Field(description="Tier of the controller's sandbox.")
    limits: dict[str, float] = Field(
        description="Limits of the controller's processes."
    )
    warnings: tuple[str, ...] = ()
    versions: dict[str, str]


class Verdict(StrictRecord):
    """Passed means: exactly the expected tests ran and each one passed."""

    passed: bool
    expected: int
    passed_tests: int
    failed_tests: int


class Report(StrictRecord):
    """One verification."""

    schema_version: Literal[1] = 1
    verdict: Verdict
    provenance: Provenance
    failures: tuple[Failure, ...]
    tests: dict[str, str] = Field(description="Outcome of each expected test.")
    episodes: tuple[Episode, ...]
    child_cpu_seconds: float
    seconds: float
    second_opinion: SecondOpinion | None = Field(
        None, description="None if no other physics was asked for, or drove."
    )

    @model_validator(mode="after")
    def _agrees(self) -> Self:
        """Rejects a verdict that does not agree with the tests."""
        passed = sum(outcome == "passed" for outcome in self.tests.values())
        counts = (len(self.tests), passed, len(self.tests) - passed)
        verdict = self.verdict
        stated = (verdict.expected, verdict.passed_tests, verdict.failed_tests)
        failed = {name for name, outcome in self.tests.items() if outcome != "passed"}
        if stated != counts or {failure.test for failure in self.failures} != failed:
            raise ValueError(
                f"expected counts {counts} and their failures, got {stated}"
            )
        if verdict.passed != (0 < passed == len(self.tests)):
            raise ValueError(f"passed={verdict.passed} contradicts counts {counts}")
        return self

    @property
    def passed(self) -> bool:
        """Whether the controller passed all tests."""
        return self.verdict.passed

    @property
    def closest(self) -> Episode | None:
        """The episode with the smallest gap; None if no gap is on record."""
        found = closest((each, each.smallest_gap) for each in self.episodes)
        return None if found is None else found[0]

    @property
    def smallest_gap(self) -> Gap | None:
        """The smallest gap of all episodes."""
        return None if self.closest is None else self.closest.smallest_gap

    @property
    def too_close(self) -> tuple[Episode, ...]:
        """The episodes that reached the goal, but came too close to an obstacle."""
        return tuple(each for each in self.episodes if each.too_close)


def id_of(nodeid: str) -> str:
    """A test's id: `test_unit.py::test_plan_path`, `own/test_mine.py::test_gap`."""
    return nodeid.removeprefix(f"{SHIPPED}/")


def group_of(test: str) -> Group:
    """The part of a suite that a test belongs to."""
    files: dict[str, Group] = {
        "test_static.py": "static",
        "test_unit.py": "unit",
        "test_end_to_end.py": "end to end",
    }
    return files.get(test.partition("::")[0], "user")


_PIXELS = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?) px\b")
# Other tests compare with grids of their own, which have no scale.
_ON_THE_MAP = "end to end"


def in_units(report: Report, units: Units) -> Report:
    """A copy whose failures read in the user's units; it is not stored.

    Figures stay in the units of the environment (`Provenance.unit`).

    Args:
        report: The report of a verification.
        units: As from `Setting.shown`.
    """
    if units.shown is None:
        return report
    failures = tuple(_failure(failure, units) for failure in report.failures)
    return report.model_copy(update={"failures": failures})


def _failure(failure: Failure, units: Units) -> Failure:
    changes: dict[str, object] = {}
    if failure.group == _ON_THE_MAP:
        changes["message"] = _PIXELS.sub(
            lambda match: units.far(float(match[1])), failure.message
        )
    diagnosis = failure.diagnosis
    if diagnosis is not None and diagnosis.shown is not None:
        text = {"text": diagnosis.shown}
        changes["diagnosis"] = diagnosis.model_copy(update=text)
    return failure.model_copy(update=changes)
