"""Promises of `movers=...`: what is understood, and what is refused in one line."""

import json

import pytest

from tdac_envs.core.errors import TaskError
from tdac_envs.movers.spec import BounceSpec, CrowdSpec, RouteSpec, read_specs

ROUTE = {"kind": "route", "points": [[1, 2], [3, 4]], "speed": 30, "radius": 8}


def test_no_movers():
    assert read_specs(None) == read_specs([]) == ()


def test_a_text_is_a_kind_with_its_defaults():
    assert read_specs("bounce:5") == (BounceSpec(count=5),)
    assert read_specs("crowd:20") == (CrowdSpec(count=20),)


def test_entries_survive_json():
    given = [ROUTE, {"kind": "bounce", "count": 3, "heading": 0.5}]
    specs = read_specs(json.loads(json.dumps(given)))
    assert specs == (RouteSpec(**ROUTE), BounceSpec(count=3, heading=0.5))
    again = [json.loads(spec.model_dump_json()) for spec in specs]
    assert read_specs(again) == specs


def test_every_key_is_documented():
    for kind in (RouteSpec, BounceSpec, CrowdSpec):
        for name, key in kind.model_fields.items():
            assert key.description or name == "kind"


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("bounse:3", "movers: unknown kind 'bounse'.*did you mean 'bounce'"),
        ("bounce", "a kind and how many there are, such as 'bounce:5', got 'bounce'"),
        ("bounce:-1", "such as 'bounce:5', got 'bounce:-1'"),
        ("bounce:1000000", "movers: expected at most 256, got 1000000"),
        ("route:3", "movers: a route needs more than a number"),
        ([ROUTE] * 257, "movers: expected at most 256, got 257"),
        (
            [{"kind": "bounce", "count": 10**6}],
            "movers: expected at most 256, got 1000000",
        ),
        (
            [{"kind": "bounce", "count": 200}] * 2,
            "movers: expected at most 256, got 400",
        ),
        ({"kind": "bounce"}, "movers: expected 'bounce:5' or"),
        (["bounce"], "movers: entry 0: expected a dict, got 'bounce'"),
        (
            [ROUTE, {"kind": "walk"}],
            "entry 1: kind: expected one of route",
        ),
        (
            [{**ROUTE, "kind": ["a"]}],
            "entry 0: kind: expected one of route",
        ),
        ([{**ROUTE, "radius": 0}], "entry 0: radius: expected more than 0, got 0"),
        ([{**ROUTE, "speed": -1}], "movers: entry 0: speed: "),
        ([{**ROUTE, "speed": float("nan")}], "movers: entry 0: speed: "),
        ([{**ROUTE, "sped": 1}], r"sped: unknown key \(did you mean 'speed'\?\)"),
        ([{"kind": "route"}], "movers: entry 0: points: is missing"),
        (
            [{**ROUTE, "points": []}],
            "entry 0: points: expected at least 1",
        ),
        ([{**ROUTE, "points": [[1, 2], [1, 2]]}], "segment 0 of the route"),
        (
            [{**ROUTE, "phase": 1.0}],
            "phase: expected less than 1, got 1",
        ),
        ([{"kind": "bounce", "heading": 90}], "entry 0: heading: expected rad, from"),
        ([{"points": [[1, 2]]}], "entry 0: kind: expected one of route, bounce"),
        ([{"kind": "bounce", "count": 2, "start": [1, 2]}], "start is for a single"),
    ],
)
def test_a_fault_is_one_line(given, message):
    with pytest.raises(TaskError, match=message) as caught:
        read_specs(given)
    assert "\n" not in str(caught.value)
