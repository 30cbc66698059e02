"""Sets of real maps: tasks of a folder, worlds of BARN, splits without a common map."""

import json
import math
import os
from pathlib import Path

import cv2
import gymnasium as gym
import numpy as np
import pytest
import yaml
from brute_force import distance

from tdac_envs import load_set
from tdac_envs.core.errors import TaskError
from tdac_envs.map2d.task import make_task

REAL = Path(os.environ.get("TDAC_DATA", Path(__file__).parents[4] / "shared" / "data"))
"""Folder of public maps and worlds; its tests are skipped where there is none."""


def floor(gap):
    """A walled floor of 120 x 80 px with an opening in the wall across it."""
    cells = np.zeros((80, 120), bool)
    cells[:3] = cells[-3:] = cells[:, :3] = cells[:, -3:] = True
    cells[: 80 - gap, 58:62] = True
    return cells


def entry(file, **more):
    """A task on a map."""
    return {"file": file, "start": [20, 20], "goal": [100, 20], **more}


@pytest.fixture
def folder(tmp_path):
    """Writes maps, by their gaps, and an index; returns the path of a set.yaml."""

    def write(gaps, entries=None, worlds=None, **values):
        maps = tmp_path / "maps"
        maps.mkdir(exist_ok=True)
        for gap in gaps:
            picture = np.where(floor(gap), 0, 255).astype(np.uint8)
            cv2.imwrite(str(maps / f"{gap}.png"), picture)
        if entries is None:
            entries = [entry(f"{gap}.png") for gap in gaps]
        (maps / "index.json").write_text(json.dumps(entries))
        worlds = {"folder": "maps", "splits": ["test"], **(worlds or {})}
        path = tmp_path / "mine.yaml"
        path.write_text(yaml.safe_dump({"worlds": worlds, **values}))
        return path

    return write


def barn_file(path, **changed):
    """Two worlds of cylinders, one of which has a wall with a gap."""
    wall = [[x / 10, 6.0] for x in range(-44, 0) if not -14 <= x <= -4]
    sides = [[x, y / 10] for x in (-4.5, 0.0) for y in range(96)]
    values = {
        "cylinder_radius": 0.075,
        "start": [-2.25, 3.0, 1.5708],
        "goal": [-2.25, 13.0],
        "worlds": {
            "free": {"cylinders": sides, "path_length": 10.5},
            "wall": {"cylinders": sides + wall, "path_length": 11.5},
        },
        **changed,
    }
    path.write_text(json.dumps(values))
    return path


def test_the_index_gives_the_tasks(folder):
    """Map, start, heading and goal are those of the files; Map2D takes the task."""
    own = [entry("20.png", heading=0.5, name="wide"), entry("30.png")]
    tasks = load_set(folder([20, 30], own))
    assert tasks.count("test") == 2
    labels = {tasks.label("test", index): index for index in range(2)}
    task = tasks.task("test", labels["maps wide"])
    assert tuple(task.start) == (20, 20, 0.5)
    assert task.goal == (100, 20)
    np.testing.assert_array_equal(task.terrain.grid.cells, floor(20))
    made = make_task(
        task.terrain, task.start, task.goal, task.robot, goal_tolerance=4.0
    )
    np.testing.assert_array_equal(made.field, task.field)


METRIC = {"robot": "turtlebot3-burger", "resolution": 0.05}


@pytest.mark.parametrize("origin", [None, (-1.0, 2.0)])
def test_an_index_in_metres(folder, origin):
    """Of the frame of each map; the heading turns to the left."""
    x, y = origin or (0.0, 0.0)
    place = {"start": [x + 1.025, y + 2.975], "goal": [x + 5.025, y + 2.975]}
    file = "20.png" if origin is None else "20.yaml"
    path = folder([20], [{"file": file, "heading": 0.5, **place}], **METRIC)
    if origin is not None:
        facts = {"image": "20.png", "resolution": 0.05, "origin": [x, y, 0.0]}
        facts |= {"negate": 0, "occupied_thresh": 0.65, "free_thresh": 0.2}
        (path.parent / "maps" / file).write_text(yaml.safe_dump(facts))
    task = load_set(path).task("test", 0)
    assert tuple(task.start) == (20, 20, -0.5)
    assert task.goal == (100, 20)
    if origin is not None:
        values = {**yaml.safe_load(path.read_text()), "resolution": 0.1}
        path.write_text(yaml.safe_dump(values))
        with pytest.raises(TaskError, match=r"give `resolution: 0.05`"):
            load_set(path)


def test_the_figures_of_a_map(folder):
    """The gap and the shortest path around the end of the wall, as brute force."""
    world = load_set(folder([20])).world("test", 0)
    assert world.difficulty.gap == pytest.approx(17 / 16, abs=0.07)
    assert (distance(world.cells, *world.path[::5].T) >= 8 - 1e-5).all()
    figures, straight = world.difficulty, 80.0
    assert figures.detour == pytest.approx(figures.length / straight, abs=1e-4)
    assert figures.length > 2 * math.hypot(38, 40)


def test_truth_is_the_map(folder, tmp_path):
    """A picture of the obstacles replaces the one of the map."""
    path = folder([20, 30], [entry("20.png", truth="30.png")])
    world = load_set(path).world("test", 0)
    np.testing.assert_array_equal(world.cells, floor(30))


def test_the_environment_drives_on_them(folder):
    """By index or at random; spaces hold every observation; equal seeds are equal."""
    path = folder([20, 30], worlds={"splits": ["train"]})
    env = gym.make("TDAC-Ladder-v0", level=str(path), split="train", train_pool=0)
    seen, _ = env.reset(seed=3, options={"index": 1})
    again, _ = env.reset(seed=3, options={"index": 1})
    for key, value in seen.items():
        np.testing.assert_array_equal(value, again[key])
    for _ in range(5):
        assert env.observation_space.contains(env.reset()[0])
    with pytest.raises(TaskError, match="world 2: set 'mine' has 2 worlds"):
        env.reset(options={"index": 2})


def test_the_hash_follows_the_maps_and_not_their_place(folder, tmp_path):
    """Another task or pixel is another set; a moved folder is not."""
    path = folder([20, 30])
    one = load_set(path).sha256
    (tmp_path / "maps").rename(tmp_path / "moved")
    text = path.read_text().replace("maps", "moved")
    path.write_text(text)
    assert load_set(path).sha256 == one
    picture = np.where(floor(20), 0, 255).astype(np.uint8)
    picture[40, 30] = 0
    cv2.imwrite(str(tmp_path / "moved" / "20.png"), picture)
    other = load_set(path).sha256
    assert other != one
    index = tmp_path / "moved" / "index.json"
    index.write_text(json.dumps([entry("20.png"), entry("30.png", heading=1.0)]))
    assert load_set(path).sha256 not in (one, other)


def test_splits_have_no_map_and_no_origin_in_common(folder):
    """Also if maps are linked by others; all worlds are in one split."""
    gaps = list(range(20, 44))
    own = [entry(f"{gap}.png", origin=f"maker {gap // 3}") for gap in gaps]
    # The same map from two makers links them.
    own.append(entry("20.png", origin=f"maker {41 // 3}", start=[20, 30]))
    tasks = load_set(folder(gaps, own, {"splits": ["train", "dev", "test"]}))
    splits = tasks.files.splits
    origins = {name: {each.origin for each in splits[name]} for name in splits}
    maps = {name: {each.content for each in splits[name]} for name in splits}
    assert sum(tasks.files.counts.values()) == 25
    assert min(tasks.files.counts.values()) > 0
    for parts in (origins, maps):
        assert len(set().union(*parts.values())) == sum(map(len, parts.values()))


def test_further_files_move_no_group(folder):
    """A world stays in its split when others are added."""
    own = [entry(f"{gap}.png", origin=f"maker {gap}") for gap in range(20, 40)]
    splits = {"splits": ["train", "dev", "test"]}
    few = load_set(folder(range(20, 40), own[:10], splits)).files.splits
    many = load_set(folder(range(20, 40), own, splits)).files.splits
    for name, worlds in few.items():
        assert {w.sha256 for w in worlds} <= {w.sha256 for w in many[name]}


def test_tasks_that_are_not_feasible(folder):
    """They are refused by file, or left out and counted."""
    with pytest.raises(TaskError, match=r"12\.png: .*8 px radius"):
        load_set(folder([20, 12]))
    masks = [entry(f"{gap}.png", truth=f"{gap}.png") for gap in (20, 12)]
    with pytest.raises(
        TaskError, match=r"12\.png: there is no way .*`infeasible: skip"
    ):
        load_set(folder([20, 12], masks))
    tasks = load_set(folder([20, 12], worlds={"infeasible": "skip"}))
    assert tasks.count("test") == 1
    assert [line.split(":")[0] for line in tasks.files.skipped] == ["12.png"]
    with pytest.raises(
        TaskError, match=r"has no feasible world; the first of 1: 12.png"
    ):
        load_set(folder([12], worlds={"infeasible": "skip"}))


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"start": [1, 1]}, r"20\.png.*start \(1, 1\)"),
        ({"goal": [500, 20]}, r"20\.png.*goal \(500, 20\) lies outside"),
        ({"goal": [22, 20]}, r"20\.png.*within the tolerance"),
        ({"goal": "there"}, "index.json, task 0: goal: "),
        ({"polarity": "blue"}, "index.json, task 0: polarity: "),
        ({"file": "no.png"}, r"no\.png: "),
        ({"file": "../mine.yaml"}, "mine.yaml is not in the folder"),
    ],
)
def test_wrong_tasks(folder, changed, message):
    """One line that names the file."""
    tasks = [{**entry("20.png", truth="20.png"), **changed}]
    if "file" in changed:
        del tasks[0]["truth"]
    with pytest.raises(TaskError, match=message) as caught:
        load_set(folder([20], tasks))
    assert "\n" not in str(caught.value)


def test_folders_that_are_refused(folder, tmp_path):
    """No folder, no index, no maps, not JSON."""
    path = folder([20])
    index = tmp_path / "maps" / "index.json"
    index.write_text("[]")
    with pytest.raises(TaskError, match=r"index.json lists no maps"):
        load_set(path)
    index.write_text("[{")
    with pytest.raises(TaskError, match=r"index.json: "):
        load_set(path)
    index.unlink()
    with pytest.raises(TaskError, match=r"has no index.json, which lists maps"):
        load_set(path)
    path = folder([20], worlds={"folder": "mapz"})
    with pytest.raises(TaskError, match=r"no folder .*mapz"):
        load_set(path)


@pytest.mark.parametrize(
    ("worlds", "values", "message"),
    [
        ({"barn": "a.json"}, {}, "expected either `folder` or `barn`"),
        ({"foldr": "a"}, {}, r"worlds\.foldr: .*did you mean"),
        ({"splits": ["hidden"]}, {}, r"worlds\.splits\.0: "),
        ({}, {"admission": {"gap": 2}}, "`admission` is for generators"),
    ],
)
def test_set_files_that_are_refused(folder, worlds, values, message):
    with pytest.raises(TaskError, match=message) as caught:
        load_set(folder([20], worlds=worlds, **values))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("hidden", 0, bytes(16)), "has no split 'hidden': its worlds are files"),
        (("train", 0), "set 'mine' has the split test, not 'train'"),
        (("test", 1), "world 1: set 'mine' has 1 worlds in its split 'test'"),
        (("tset", 0), "did you mean 'test'"),
    ],
)
def test_worlds_that_do_not_exist(folder, arguments, message):
    with pytest.raises(TaskError, match=message):
        load_set(folder([20])).world(*arguments)


def kept_back(folder, tmp_path, gaps, **more):
    """Moves the maps of a set to another folder, and writes the set anew."""
    folder(gaps, [entry(f"{gap}.png", **more) for gap in gaps])
    (tmp_path / "maps").rename(tmp_path / "hidden")
    return tmp_path / "hidden"


def test_a_folder_that_was_kept_back(folder, tmp_path):
    """It is the split `hidden`, and changes nothing of the others."""
    hidden = kept_back(folder, tmp_path, (34, 36))
    path = folder((30, 32))
    public, tasks = load_set(path), load_set(path, hidden)
    assert tasks.sha256 == public.sha256
    assert tasks.count("hidden") == 2
    assert public.count("hidden") == 0
    options = {"level": path, "split": "hidden", "hidden_folder": hidden}
    env = gym.make("TDAC-Ladder-v0", **options).unwrapped
    env.reset(options={"index": 1})
    cells = tasks.world("hidden", 1).cells
    assert np.array_equal(env.task.terrain.grid.cells, cells)
    assert any(np.array_equal(cells, floor(gap)) for gap in (34, 36))
    assert tasks.key("hidden", 0, "noise") != public.key("test", 0, "noise")


@pytest.mark.parametrize(
    ("gaps", "origin", "what"), [((30,), None, "map"), ((34,), "here", "origin")]
)
def test_hidden_maps_that_are_public(folder, tmp_path, gaps, origin, what):
    """Nothing of the set may be in the folder that was kept back."""
    hidden = kept_back(folder, tmp_path, gaps, origin=origin)
    path = folder((30, 32), [entry(f"{gap}.png", origin="here") for gap in (30, 32)])
    with pytest.raises(TaskError, match=f"its {what} is also in the public part"):
        load_set(path, hidden)


def test_a_hidden_folder_is_for_files(tmp_path):
    with pytest.raises(
        TaskError, match=r"'known' generates its worlds: .* a salt file"
    ):
        load_set("known", tmp_path)


def test_a_split_without_worlds(folder):
    """One map cannot be in three splits."""
    tasks = load_set(folder([20], worlds={"splits": ["train", "dev", "test"]}))
    empty = [name for name, count in tasks.files.counts.items() if count == 0]
    assert len(empty) == 2
    with pytest.raises(TaskError, match="has no worlds in its split"):
        tasks.world(empty[0], 0)


def test_worlds_of_barn(tmp_path):
    """Cylinders are discs, north is up, and OT is half the given length per m/s."""
    barn_file(tmp_path / "worlds.json")
    path = tmp_path / "barn.yaml"
    worlds = {"barn": "worlds.json", "splits": ["test"], "resolution": 0.025}
    path.write_text(yaml.safe_dump({"worlds": worlds, "goal_tolerance": 40}))
    tasks = load_set(path)
    labels = [tasks.label("test", index) for index in range(2)]
    assert sorted(labels) == ["barn free", "barn wall"]
    world = tasks.world("test", labels.index("barn wall"))
    # 10 m are 400 px, up.
    assert world.goal[1] == world.start.y - 400
    assert world.goal[0] == world.start.x
    assert world.start.heading == pytest.approx(-math.pi / 2, abs=1e-3)
    assert world.barn_steps == pytest.approx(11.5 / 2 / 0.1)
    # The wall is 3 m ahead, and occupies what is in a cylinder of 3 px.
    x, y = round(world.start.x), round(world.start.y) - 120
    assert world.cells[y - 1 : y + 2, x].all()
    assert not world.cells[y - 4, :].all()
    # The opening is on the right-hand side.
    assert not world.cells[y, x + 54 : x + 60].any()
    assert world.difficulty.detour > 1.0


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"worlds": {}}, "worlds.json: worlds: "),
        ({"cylinder_radius": 0}, "worlds.json: cylinder_radius: "),
        ({"goal": [1e6, 0]}, "use a coarser `resolution`"),
    ],
)
def test_files_of_barn_that_are_refused(tmp_path, changed, message):
    barn_file(tmp_path / "worlds.json", **changed)
    path = tmp_path / "barn.yaml"
    path.write_text("worlds: {barn: worlds.json}\n")
    with pytest.raises(TaskError, match=message):
        load_set(path)


def test_a_missing_file_of_barn(tmp_path):
    path = tmp_path / "barn.yaml"
    path.write_text("worlds: {barn: worlds.json}\n")
    with pytest.raises(TaskError, match=r"worlds\.json: No such file"):
        load_set(path)


@pytest.mark.slow
def test_the_shipped_worlds_of_barn():
    """50 worlds with a log are for tests; a world has ten runs with their own noise."""
    tasks = load_set("barn")
    counts = tasks.files.counts
    assert counts["test"] == 500
    assert counts["train"] + counts["dev"] == 2000
    labels = [tasks.label("test", index) for index in range(100)]
    numbers = {int(label.removeprefix("barn ")) for label in labels}
    assert labels[:50] == labels[50:]
    assert numbers == set(range(0, 300, 6))
    env = gym.make("TDAC-Ladder-v0", level="barn", split="test")
    seen = [env.reset(options={"index": index})[0]["ranges"] for index in (3, 53)]
    assert not np.array_equal(*seen)
    assert np.allclose(*seen, rtol=0.2)
    assert tasks.runs("test", 20) == tasks.runs("test", 50) == 1
    assert tasks.runs("test", 150) == 3
    with pytest.raises(TaskError, match="expected a multiple of 50"):
        tasks.runs("test", 60)
    with pytest.raises(TaskError, match="has 500 worlds in its split 'test'"):
        tasks.world("test", 500)


@pytest.mark.parametrize(
    ("worlds", "message"),
    [
        ({"tests": ["other"]}, "`tests`: there is no world 'other'"),
        ({"tests": ["wall"], "splits": ["test"]}, "needs the splits train, dev and"),
        ({"runs": 0}, "runs"),
        ({"runs": 2}, "`runs` needs `disturbances` that are random"),
    ],
)
def test_worlds_for_tests_that_are_refused(tmp_path, worlds, message):
    barn_file(tmp_path / "worlds.json")
    path = tmp_path / "barn.yaml"
    path.write_text(yaml.safe_dump({"worlds": {"barn": "worlds.json", **worlds}}))
    with pytest.raises(TaskError, match=message):
        load_set(path)


def test_named_worlds_are_for_tests(tmp_path):
    barn_file(tmp_path / "worlds.json")
    path = tmp_path / "barn.yaml"
    worlds = {"barn": "worlds.json", "tests": ["wall"]}
    path.write_text(yaml.safe_dump({"worlds": worlds, "goal_tolerance": 40}))
    tasks = load_set(path)
    assert tasks.label("test", 0) == "barn wall"
    assert tasks.count("test") == 1
    assert tasks.count("train") + tasks.count("dev") == 1


@pytest.mark.slow
@pytest.mark.skipif(not (REAL / "maps").is_dir(), reason="no folder of public maps")
def test_public_maps(tmp_path):
    """Real maps of many kinds are worlds; those without a way are counted."""
    worlds = {"folder": str(REAL / "maps"), "infeasible": "skip"}
    path = tmp_path / "maps.yaml"
    path.write_text(yaml.safe_dump({"worlds": worlds}))
    tasks = load_set(path)
    counts = tasks.files.counts
    assert sum(counts.values()) + len(tasks.files.skipped) == 68
    assert min(counts.values()) > 0
    assert tasks.task("test", 0).shortest > 0


@pytest.mark.slow
@pytest.mark.skipif(not (REAL / "barn").is_dir(), reason="no worlds of BARN")
def test_public_worlds_of_barn(tmp_path):
    """All are feasible for a disc as wide as the challenge's robot."""
    worlds = {"barn": str(REAL / "barn" / "worlds.json"), "splits": ["test"]}
    values = {"worlds": worlds, "robot": {"radius": 8.6}, "goal_tolerance": 40}
    path = tmp_path / "barn.yaml"
    path.write_text(yaml.safe_dump(values))
    tasks = load_set(path)
    assert tasks.count("test") == 250
    assert tasks.world("test", 7).barn_steps > 50


def test_a_map_whose_walls_are_neither_dark_nor_light(folder):
    """Its `truth` says what the walls are; `mixed` is a polarity like the others."""
    mixed = entry("20.png", polarity="mixed", truth="20.png")
    assert load_set(folder([20], [mixed])).count("test") == 1
