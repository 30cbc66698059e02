"""`tdac sets`: a list, the figures of a world, pictures, one line for each mistake."""

import json

import cv2
import pytest

from tdac_envs import load_set
from tdac_envs.ladder.set_file import set_names

FIGURES = ("gap", "steps", "detour", "in_sight", "density", "dead_ends", "excess")


def test_it_lists_the_sets(tdac):
    code, out, err = tdac("sets")
    assert (code, err) == (0, "")
    for name in set_names():
        assert name in out
    assert "odometry" in out
    assert "the map" in out


def test_its_json_is_complete(tdac):
    """All values with the defaults, and the hash of each set."""
    code, out, _ = tdac("sets", "--json")
    records = json.loads(out)
    assert code == 0
    assert [each["name"] for each in records] == list(set_names())
    for each in records:
        assert each["sha256"] == load_set(each["name"]).sha256
        assert each["horizon"] == {"factor": 16.0, "least": 400, "most": 2000}


def test_it_shows_a_set(tdac):
    code, out, err = tdac("sets", "show", "lost")
    assert (code, err) == (0, "")
    for said in ("wheel_gains 0.12", "24 rays over 180°", "mazes, rooms", "delay 1"):
        assert said in out
    assert "gap" not in out


def test_it_shows_a_world(tdac):
    """With its figures; the same world that the environment drives on."""
    code, out, _ = tdac("sets", "show", "unknown", "--index", "2", "--split", "test")
    assert code == 0
    assert "test 2" in out
    assert "caves, 220 x 220 px" in out
    words = ("sets", "show", "unknown", "--index", "2", "--split", "test", "--json")
    shown = json.loads(tdac(*words)[1])["world"]
    task = load_set("unknown").task("test", 2)
    assert shown["start"] == list(task.start)
    assert shown["goal"] == list(task.goal)
    assert shown["horizon"] == task.horizon
    assert all(isinstance(shown[key], float) for key in FIGURES)


def test_it_draws(tdac, tmp_path):
    """One world, and a sheet of 24; a folder is made if need be."""
    one, many = tmp_path / "new" / "one.png", tmp_path / "many.png"
    words = ("--png", str(one), "--sheet", str(many))
    code, out, err = tdac("sets", "show", "known", *words)
    assert (code, err) == (0, "")
    assert out.count("drew ") == 2
    pictures = [cv2.imread(str(path)) for path in (one, many)]
    assert pictures[0].shape[:2] == (880, 880)
    # Six worlds in a row, each 260 px wide.
    assert pictures[1].shape[1] == 6 * 270 + 10
    assert min(picture.std() for picture in pictures) > 10
    code, out, _ = tdac("sets", "show", "known", "--json", *words)
    json.loads(out)


def test_sets_of_ones_own(tdac, tmp_path):
    path = tmp_path / "few.yaml"
    path.write_text("worlds: [{name: aisles, width: 300, height: 240}]\n")
    code, out, err = tdac("sets", "show", str(path), "--index", "0")
    assert (code, err) == (0, "")
    assert "few" in out
    assert "300 x 240 px" in out or "240 x 300 px" in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("unkown",), "unknown task set 'unkown'; expected known, unknown, lost"),
        (("no.yaml",), "no.yaml: No such file or directory"),
        (("known", "--png", "world.jpg"), "--png must end in .png, got world.jpg"),
        (("known", "--sheet", "sheet"), "--sheet must end in .png, got sheet"),
        (("known", "--index", "-1"), "--index"),
        (("known", "--split", "hidden"), "--split"),
    ],
)
def test_mistakes_are_one_line(tdac, words, message):
    code, out, err = tdac("sets", "show", *words)
    assert (code, out) == (2, "")
    assert message in err
    assert err.startswith("error: ")
    assert len(err.splitlines()) == 1
