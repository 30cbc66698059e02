"""What a report takes from `falsify.json`, which may come from anywhere."""

import copy
import json
import os

import pytest

from tdac_agent.html_report.envelope import envelope_of
from tdac_agent.html_report.page import _environment
from tdac_agent.storage.hashes import sha256_of

SOURCE = b"def policy(obs):\n    return 0.0, 0.0\n"
ROW = {"seed": 0, "outcome": "collision", "steps": 99, "cause": "collision"}
ALONE = {
    "part": "delay",
    "sign": 1,
    "survives": 2.0,
    "fails": 3.0,
    "limit": 3.0,
    "cause": "collision",
}
RECORD = {
    "name": "maze",
    "sha256": "0" * 64,
    "dynamics": "1",
    "policy": "controller.py",
    "policy_sha256": sha256_of(SOURCE),
    "unit": "px",
    "frame": [100, 0.05, 0.0, 0.0, 0.0],
    "radius": 15.0,
    "dt": 0.05,
    "space": {"delay": 1.0, "axle": 0.05},
    "seed": 0,
    "budget": 64,
    "episodes": 60,
    "sandbox": "namespaces",
    "envelopes": [
        {
            "number": 0,
            "base": {**ROW, "outcome": "reached", "cause": None},
            "directions": [ALONE],
            "counterexample": {
                "number": 0,
                "deviation": {"delay": 3, "axle": 0.01},
                "norm": 3.0,
                "found_by": "single",
                "row": {**ROW, "text": "case 3: it touched a wall. Then more"},
            },
            "episodes": 60,
        }
    ],
    "curves": [{"part": "delay", "value": 1.0, "count": 3, "successes": 2}],
    "versions": {"numpy": "2"},
}
NASTY = (
    *(float("nan"), float("inf"), 1e308, -1e308, 1e-320, 0, -1, 10**400, True),
    *("", "x\x1b[31m\ud800", "evil", None, [], {}, {"evil": 1}),
)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "controller.py").write_bytes(SOURCE)
    return tmp_path


def leave(folder, text):
    (folder / "falsify.json").write_text(text)


def shown(found):
    """The panel of the page."""
    return _environment().get_template("envelope.html.j2").render(envelope=found)


def places(value, place=()):
    """The places of all values inside a value."""
    yield place
    inside = value.items() if isinstance(value, dict) else ()
    for key, each in enumerate(value) if isinstance(value, list) else inside:
        yield from places(each, (*place, key))


def changed(place, new):
    """The record with another value at a place."""
    if not place:
        return new
    record = copy.deepcopy(RECORD)
    inner = record
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = new
    return record


def test_it_has_the_smallest_failure_and_says_that_it_is_a_search(folder):
    leave(folder, json.dumps(RECORD))
    found = envelope_of(folder)
    assert "delay 3 steps" in found["failure"]
    assert "it touched a wall" in found["failure"]
    assert "search of 60 episodes, not a proof" in found["note"]
    assert "<td>3 steps</td>" in shown(found)


def test_texts_of_a_record_are_no_markup(folder):
    row = {**ROW, "text": "case 3: <script>alert(1)</script>. Then more"}
    place = ("envelopes", 0, "counterexample", "row")
    leave(folder, json.dumps(changed(place, row)))
    page = shown(envelope_of(folder))
    assert "<script>" not in page
    assert "&lt;script&gt;" in page


def test_nothing_is_said_without_a_record(folder):
    assert envelope_of(folder) is None


def test_a_damaged_record_or_that_of_another_controller_is_named(folder):
    leave(folder, json.dumps(RECORD)[:-5])
    assert envelope_of(folder) == {
        "left_out": "falsify.json cannot be read, or is damaged"
    }
    leave(folder, json.dumps({**RECORD, "policy_sha256": "2" * 64}))
    assert envelope_of(folder) == {"left_out": "falsify.json is of another controller"}
    assert "of another controller" in shown(envelope_of(folder))


@pytest.mark.slow
def test_no_value_breaks_a_report(folder):
    """Any value may be wrong: the record is left out, or what is told is finite."""
    for place in places(RECORD):
        for new in NASTY:
            leave(folder, json.dumps(changed(place, new)))
            found = envelope_of(folder)
            assert found["left_out"] or found["summary"]
            assert shown(found)


@pytest.mark.parametrize("text", ["[" * 100_000, "1" * 5000, '{"name": ' * 2000])
def test_a_deep_or_long_record_is_left_out(folder, text):
    leave(folder, text)
    assert envelope_of(folder)["left_out"]


def test_neither_a_pipe_nor_a_huge_file_is_read(folder):
    os.mkfifo(folder / "falsify.json")
    assert envelope_of(folder)["left_out"]
    (folder / "falsify.json").unlink()
    with (folder / "falsify.json").open("wb") as file:
        file.truncate(8 << 30)
    assert envelope_of(folder)["left_out"]


def test_no_link_leads_out_of_the_folder(folder, tmp_path_factory):
    """Or a run folder from elsewhere could have a file of the reader in its report."""
    outside = tmp_path_factory.mktemp("outside")
    (outside / "secret").write_bytes(b"secret")
    (folder / "counterexample.png").symlink_to(outside / "secret")
    leave(folder, json.dumps(RECORD))
    assert envelope_of(folder)["picture"] is None
    (folder / "falsify.json").rename(outside / "falsify.json")
    (folder / "falsify.json").symlink_to(outside / "falsify.json")
    assert envelope_of(folder)["left_out"]
