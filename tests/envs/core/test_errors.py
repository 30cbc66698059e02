"""A validation error becomes a line that says which keys and values are possible."""

from typing import Annotated, Literal

import pytest
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from tdac_envs.core.errors import first_problem


class Part(BaseModel):
    """A part of a file."""

    model_config = ConfigDict(extra="forbid")

    kind: Literal["part"] = "part"
    max_speed: float = Field(1.0, gt=0, description="m/s")
    radius: float = 0.1


class Other(BaseModel):
    """Another kind of part."""

    model_config = ConfigDict(extra="forbid")

    kind: Literal["other"] = "other"
    size: int = 1


class File(BaseModel):
    """A file with parts."""

    model_config = ConfigDict(extra="forbid")

    version: Literal[1] = Field(1, alias="schema")
    runs: int = Field(1, ge=1, description="R: runs of each kind.")
    robot: Part = Part()
    parts: tuple[Annotated[Part | Other, Field(discriminator="kind")], ...] = ()


@pytest.mark.parametrize(
    ("values", "line"),
    [
        (
            {"runz": 1},
            "runz: unknown key (did you mean 'runs'?); known: runs, robot, parts, "
            "schema",
        ),
        (
            {"R": 1},
            "R: unknown key (did you mean 'runs'?); known: runs, schema, robot, parts",
        ),
        ({"zzz": 1}, "zzz: unknown key; known: schema, runs, robot, parts"),
        (
            {"robot": {"speed": 1}},
            "robot.speed: unknown key (did you mean 'max_speed'?); known: max_speed, "
            "kind, radius",
        ),
        (
            {"parts": [{"kind": "other", "sise": 1}]},
            "parts.0.other.sise: unknown key (did you mean 'size'?); known: size, kind",
        ),
        ({"runs": 0}, "runs: expected at least 1, got 0 (R: runs of each kind)"),
        (
            {"robot": {"max_speed": -1}},
            "robot.max_speed: expected more than 0, got -1 (m/s)",
        ),
        ({"schema": 2}, "schema: Input should be 1"),
    ],
)
def test_a_problem_is_a_line_with_what_is_possible(values, line):
    """Known keys of the same mapping, the nearest first; what a value means."""
    with pytest.raises(ValidationError) as caught:
        File.model_validate(values)
    assert first_problem(caught.value, File) == line


def test_a_form_may_be_any_type():
    """A list of models, as answers of models have them; without it, no keys follow."""
    with pytest.raises(ValidationError) as caught:
        TypeAdapter(list[Other]).validate_python([{"sise": 1}])
    told = "0.sise: unknown key"
    assert first_problem(caught.value) == told
    meant = " (did you mean 'size'?); known: size, kind"
    assert first_problem(caught.value, list[Other]) == told + meant
