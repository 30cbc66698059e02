"""`tdac world`: a table, a picture, clean JSON, one clear line for each mistake."""

import json
from pathlib import Path

import cv2
import pytest

from tdac_envs import read_world
from tdac_envs.worlds.bundled import bundled_worlds, world_file
from tdac_envs.worlds.wbt.reader import load_world

WORLD = """#VRML_SIM R2025a utf8
WorldInfo { basicTimeStep 16 }
CircleArena { radius 0.8 }
E-puck { translation -0.4 0.1 0 rotation 0 0 1 0.5 }
WoodenBox { translation 0.2 0.3 0.05 name "box [1]" size 0.2 0.1 0.1 mass 0.5 }
Dragon { name "Smaug" translation 0.1 0 0 }
DEF GOAL Solid { translation 0.5 0.2 0 }
"""


@pytest.fixture(autouse=True)
def small(tdac):
    """The world, in the folder of the command."""
    Path("small.wbt").write_text(WORLD)


def test_it_shows_what_is_in_a_world(tdac):
    """Robot, goal, arena, obstacles, and what is not modelled with its line."""
    code, out, err = tdac("world", "small.wbt")
    assert (code, err) == (0, "")
    for said in (
        "Webots R2025a, step 16 ms", "(-0.4, 0.1), heading 0.5 rad, version 1",
        "(0.5, 0.2)", "radius 0.8 m", "box [1]", "(0.2, 0.3)  0.2 x 0.1", "Smaug",
        "an unknown node or PROTO", "--ignore NAME",
    ):  # fmt: skip
        assert said in out


@pytest.mark.parametrize("world", bundled_worlds())
def test_a_thing_has_a_line(tdac, monkeypatch, world):
    """In a terminal of 80 columns, too."""
    monkeypatch.setenv("COLUMNS", "80")
    _, out, _ = tdac("world", world)
    _, _, table = out.partition("obstacles (m, rad, kg)")
    _, _, *rows, mark = [line for line in table.splitlines() if line.strip()]
    assert mark.strip() == "* visible but not solid"
    assert len(rows) == len(load_world(world_file(world)).obstacles)
    assert max(map(len, out.splitlines())) <= 80


def test_it_draws(done, tmp_path):
    """A PNG, in a folder that is made if need be."""
    out = done("world", "small.wbt", "--png", "new/small.png")
    assert "new/small.png" in out
    assert cv2.imread("new/small.png").shape[2] == 3


def test_its_json_is_complete(tdac):
    """All numbers of the world, and nothing else on stdout."""
    code, out, _ = tdac("world", "small.wbt", "--json")
    record, world = json.loads(out), read_world(WORLD)
    assert code == 0
    assert record["goal"] == [0.5, 0.2]
    assert record["time_step"] == 16
    assert record["floor"] == 0
    assert record["robots"][0]["max_wheel_speed"] == 6.28
    assert record["arenas"][0]["kind"] == "CircleArena"
    assert record["unmodelled"][0]["line"] == 6
    box = record["obstacles"][0]
    assert (box["kind"], box["mass"]) == ("WoodenBox", 0.5)
    (part,) = box["solid"]
    assert part["kind"] == "rectangle"
    assert part["vertices"] == world.obstacles[0].solid[0].shape.vertices.tolist()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nope.wbt"], "error: nope.wbt: no such file; check the path"),
        (["broken.wbt"], "error: broken.wbt, line 1, column 1: expected a header"),
        (["small.wbt", "--png", "x.jpg"], "error: --png must end in .png, got x.jpg"),
    ],
)
def test_mistakes_are_one_line(refused, tmp_path, words, said):
    """Exit 2, nothing on stdout."""
    Path("broken.wbt").write_text("WorldInfo {")
    err = refused("world", *words)
    assert err.startswith(said)
    assert err.count("\n") == 1


@pytest.mark.parametrize("name", ["arena", "arena.wbt"])
def test_a_bundled_world(tdac, name):
    """It goes by its name, and by that of its file where there is no such file."""
    code, out, err = tdac("world", name)
    assert (code, err) == (0, "")
    assert "arena.wbt" in out
    assert "WoodenBox" in out
