"""`tdac sets`: a list, the figures of a world, pictures, one line for each mistake."""

import json
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest

from tdac_envs import load_set
from tdac_envs.ladder.set_file import set_names, shipped_names

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
    assert [each["name"] for each in records] == list(shipped_names())
    for each in records[: len(set_names())]:
        assert each["sha256"] == load_set(each["name"]).sha256
        assert each["horizon"] == load_set(each["name"]).file.horizon.model_dump()
    units = {each["name"]: each["unit"] for each in records}
    assert (units["unknown"], units["epuck"]) == ("px", "m")


def test_its_json_names_the_unit_of_its_lengths(tdac):
    """Px on maps, also for a set in metres, whose text is in metres."""
    words = ("sets", "show", "floor", "--index", "0")
    shown, text = json.loads(tdac(*words, "--json")[1]), tdac(*words)[1]
    length, per_px = shown["world"]["length"], shown["resolution"]
    assert shown["unit"] == "px"
    assert shown["robot"]["radius"] * per_px == pytest.approx(0.105)
    assert f"{length * per_px:.4g} m, " in text


def test_it_shows_a_set(tdac):
    code, out, err = tdac("sets", "show", "lost")
    assert (code, err) == (0, "")
    for said in ("wheel_gains 0.12", "24 rays over 180°", "mazes, rooms", "delay 1"):
        assert said in out
    assert "gap" not in out


def test_it_shows_a_world(tdac, done):
    """With its figures; the same world that the environment drives on."""
    out = done("sets", "show", "unknown", "--index", "2", "--split", "test")
    assert "test 2" in out
    assert "caves, 220 x 220 px" in out
    words = ("sets", "show", "unknown", "--index", "2", "--split", "test", "--json")
    shown = json.loads(tdac(*words)[1])["world"]
    task = load_set("unknown").task("test", 2)
    assert shown["start"] == list(task.start)
    assert shown["goal"] == list(task.goal)
    assert shown["horizon"] == task.horizon
    assert all(isinstance(shown[key], float) for key in FIGURES)


@pytest.mark.slow
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
def test_mistakes_are_one_line(refused, words, message):
    err = refused("sets", "show", *words)
    assert message in err
    assert err.startswith("error: ")
    assert len(err.splitlines()) == 1


@pytest.fixture
def of_maps(tmp_path):
    """A set of one map; returns the path of its set.yaml."""
    picture = np.full((80, 120), 255, np.uint8)
    picture[:3] = picture[-3:] = picture[:, :3] = picture[:, -3:] = 0
    picture[:60, 58:62] = 0
    cv2.imwrite(str(tmp_path / "one.png"), picture)
    task = {"file": "one.png", "start": [20, 20], "goal": [100, 20]}
    (tmp_path / "index.json").write_text(json.dumps([task]))
    path = tmp_path / "mine.yaml"
    path.write_text("worlds: {folder: ., splits: [test]}\n")
    return path


def test_it_shows_maps_of_a_folder(tdac, of_maps, tmp_path):
    """How many worlds there are, a world with its file, and a sheet of all."""
    sheet = tmp_path / "sheet.png"
    words = ("--split", "test", "--index", "0", "--sheet", str(sheet))
    code, out, err = tdac("sets", "show", str(of_maps), *words)
    assert (code, err) == (0, "")
    assert "1 test" in out
    assert "maps one.png, 120 x 80 px" in out
    assert cv2.imread(str(sheet)).std() > 10
    record = json.loads(tdac("sets", "show", str(of_maps), "--json")[1])
    assert record["files"]["counts"] == {"test": 1}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("sets", "show", "SET", "--index", "0"), "has the split test, not 'dev'"),
        (("sets", "show", "SET", "--split", "test", "--index", "1"), "has 1 worlds"),
        (("verify", "c.py", "--set", "SET", "-n", "2"), "-n 2: set 'mine' has 1"),
        (("verify", "c.py", "--set", "SET", "-n", "0"), "--worlds"),
        (("verify", "c.py", "--set", "SET", "--split", "hidden", "-n", "1"), "hidden"),
        (("verify", "c.py", "--set", "SET"), "episodes"),
        (("verify", "c.py", "--set", "mapz.yaml"), "mapz.yaml: No such file"),
        (("verify", "c.py", "--set", "lots"), "did you mean 'lost'?"),
        (
            ("verify", "c.py", "--set", "lost", "--split", "hidden"),
            "split 'hidden' needs a salt",
        ),
        (
            ("verify", "c.py", "--set=lost", "--split=hidden", "--salt-file=no.salt"),
            "salt file no.salt: No such file",
        ),
    ],
)
def test_mistakes_with_sets_are_one_line(refused, of_maps, tmp_path, words, message):
    """Worlds, splits, sets and salts that do not exist."""
    controller = tmp_path / "c.py"
    controller.write_text("def policy(obs):\n    return 0.0, 0.0\n")
    places = {"SET": str(of_maps), "c.py": str(controller)}
    err = refused(*(places.get(word, word) for word in words))
    assert message in err
    assert err.startswith("error: ")


def test_a_junit_file_of_a_set(tdac, tmp_path):
    """A case for each test, and for each world; here a test fails before any world."""
    (tmp_path / "bad.py").write_text("def drive(obs):\n    return 0.0, 0.0\n")
    words = ("verify", tmp_path / "bad.py", "unknown", "-n", "3", "--junit", "a.xml")
    code, out, err = tdac(*words)
    assert (code, err) == (1, "")
    assert "so no world was driven" in out
    root = ElementTree.parse("a.xml").getroot()
    assert int(root.get("tests")) == len(root) > 0
    assert 0 < int(root.get("failures")) == len(root.findall("testcase/failure"))
    assert {case.get("classname") for case in root} == {"static"}
    assert all(case.get("name") for case in root)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("verify a.py --set unknown --paper", "--set brings its own tasks; leave out "),
        ("verify a.py unknown --start 1 2", "leave out --start"),
        ("verify a.py unknown --profile paper", "has only the profile policy: the fu"),
        ("synth unknown --profile paper", "has only the profile policy: the functions"),
        ("verify a.py unknown --seed 3", "all that happens in an episode follows from"),
        ("verify a.py unknown --suite tests", "no suite 'tests': no such folder"),
        ("verify a.py --split dev", "--split needs --set NAME"),
        ("play a.py unknown --episode nominal", "leave out --episode"),
        ("evaluate random unknown --seed 3", "leave out --seed"),
        ("evaluate random --split dev", "--split needs --set NAME"),
        ("evaluate unknown", "no policy: give files, run folders, or names such as"),
        ("evaluate random unknown lost", "give lost or --set, not both"),
        ("synth unknown --suite tests", "no suite 'tests': no such folder"),
        ("synth --then-verify", "--then-verify needs --set NAME"),
        ("check-suite unknown", "unknown is a task set; this command needs a single"),
        ("train maze unknown", "--set brings its own tasks; leave out --task"),
    ],
)
def test_flags_of_tasks_and_of_sets(refused, words, message):
    """One line names the flag."""
    if words.startswith("train"):
        pytest.importorskip("stable_baselines3")
    Path("a.py").write_text("def policy(obs):\n    return 0.0, 0.0\n")
    err = refused(*words.split())
    assert message in err
