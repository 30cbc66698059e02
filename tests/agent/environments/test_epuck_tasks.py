"""Tasks in worlds: what a file may ask for, and the folder that a controller gets."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
import yaml

from tdac_agent import load_task
from tdac_agent.environments.epuck.entry import EPUCK
from tdac_agent.environments.epuck.flat_world import flat_world
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.task import portable_task_file, write_workdir
from tdac_agent.tasks.task_file import TaskFile, bundled_tasks
from tdac_envs import bundled_maps, bundled_worlds, load_world, read_world
from tdac_envs.core.errors import TaskError, WorldError
from tdac_envs.epuck.ground import Ground
from tdac_envs.epuck.infrared import TABLE
from tdac_envs.worlds.bundled import world_file
from tdac_envs.worlds.footprint import Disc, Rectangle
from tdac_envs.worlds.wbt.writer import write_world
from tdac_envs.worlds.world import Arena, EPuck, Obstacle, Part, Unmodelled, World

WORLDS = [name for name in bundled_tasks() if name.startswith("epuck")]
LEGO = '\nLegoTallWall {\n  translation 0.1 0.7 0\n  name "north"\n}\n'


def room(**changes) -> World:
    """A room with a post, a second e-puck, and a mark of the goal."""
    post = (Part(Disc(0.3, 0.1, 0.05), 0.0, 0.1),)
    mark = (Part(Disc(0.6, 0.0, 0.04), 0.0, 0.002),)
    world = World(
        robots=(EPuck("one", -0.6, 0.0, 0.3), EPuck("two", 0.0, -0.3, 1.0)),
        goal=(0.6, 0.0),
        arenas=(Arena(Rectangle(0.0, 0.0, 0.0, 1.6, 1.0), 0.01, 0.1),),
        obstacles=(
            Obstacle("post", "Solid", 0.3, 0.1, post, post),
            Obstacle("the GOAL", "Solid", 0.6, 0.0, (), mark, is_goal=True),
        ),
    )
    return replace(world, **changes)


def in_file(folder, world, **spec):
    """The task of a world that was written to a file."""
    (folder / "w.wbt").write_text(write_world(world))
    return load_task(TaskFile(env=EPUCK.id, world="w.wbt", **spec), base=folder)


@pytest.mark.parametrize("name", WORLDS)
def test_a_working_folder_says_the_same(name, tmp_path):
    """The folder's own task.yaml gives the same task, to the last bit of an episode."""
    task = load_task(name)
    write_workdir(tmp_path, task)
    (tmp_path / "task.yaml").write_text(portable_task_file(task))
    again = load_task(tmp_path)
    assert again.name == name
    assert again.sha256() == task.sha256()
    assert again.nominal.ground.world == task.nominal.ground.world
    poses = []
    for one in (task, again):
        env = one.make_env()
        env.reset(seed=0)
        for k in range(60):
            env.step(np.array([0.4 + 0.01 * k, 0.5], np.float32))
        poses.append(env.pose())
    assert np.array_equal(*poses)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"params.json", "sensors.py", "task.yaml", "world.wbt"}


@pytest.mark.parametrize("name", WORLDS)
def test_params_are_those_of_the_environment(name, tmp_path):
    """`params.json` has start, goal and the numbers that the environment has."""
    task = load_task(name)
    write_workdir(tmp_path, task)
    params = json.loads((tmp_path / "params.json").read_text())
    env = task.make_env()
    observation, _ = env.reset(seed=0)
    assert observation["pose"] == pytest.approx([*params["start"], params["heading"]])
    assert observation["goal"] == pytest.approx(params["goal"])
    assert params["dt"] == env.task.dt
    assert params["horizon"] == env.task.horizon
    assert params["goal_tolerance"] == env.task.goal_tolerance
    robot = params["robot"]
    before = env.pose()
    env.step(np.array([1.0, 1.0], np.float32))
    way = math.dist(before[:2], env.pose()[:2])
    full = robot["max_wheel_speed"] * robot["wheel_radius"] * params["dt"]
    assert way == pytest.approx(full, rel=1e-9)
    env.step(np.array([-0.5, 0.5], np.float32))
    assert env.pose()[2] - before[2] == pytest.approx(full / robot["axle_length"])


@pytest.mark.parametrize(("kinematic", "axle"), [(False, 0.057), (True, 0.052)])
def test_a_controller_is_told_the_axle_by_which_it_turns(tmp_path, kinematic, axle):
    """In the folder, the prompt, the template and the world that it reads."""
    robot = replace(room().robot, kinematic=kinematic)
    task = in_file(tmp_path, room(robots=(robot,)))
    assert task.params.robot.axle_length == task.nominal.axle_length == axle
    assert EPUCK.prompt_facts(task)["axle"] == f"{axle:g}"
    facts = [EPUCK.template(task.setting).facts, EPUCK.privileged_facts(task.nominal)]
    assert [own["axle_length"] for own in facts] == [axle, axle]
    env = task.make_env()
    env.reset(seed=0)
    before = env.pose()[2]
    env.step(np.array([-1.0, 1.0], np.float32))
    assert env.pose()[2] - before == pytest.approx(2 * task.nominal.full_step / axle)


def test_names_of_bundled_tasks():
    """A world's task has a name of its own where a map is called the same."""
    assert bundled_tasks() == (*bundled_maps(), *WORLDS)
    assert len(set(bundled_tasks())) == len(bundled_maps()) + len(bundled_worlds())
    assert load_task("maze").spec.env != load_task("epuck-maze").spec.env
    assert load_task("epuck").params.source == "arena.wbt"


def test_the_flat_world_has_one_robot_and_one_goal():
    """What stands is an obstacle, and there is nothing else called GOAL."""
    flat = flat_world(room(), 0.016)
    text = write_world(flat)
    assert read_world(text) == flat
    assert text.count("\nE-puck {") == 1
    assert text.count("DEF GOAL Solid") == text.count('"GOAL"') == 1
    assert "basicTimeStep 16\n" in text
    assert [t.kind for t in flat.obstacles] == ["Solid", "Solid", "E-puck"]
    assert flat.obstacles[0].visible == room().obstacles[1].visible


def test_the_flat_world_is_as_hard():
    """An e-puck hits the same things in it, at the same places."""
    random = np.random.default_rng(0)
    for world in (room(), *(load_world(world_file(n)) for n in bundled_worlds())):
        ground, flat = Ground.of(world), Ground.of(flat_world(world, 0.032))
        assert ground.bounds == flat.bounds
        for x, y in random.uniform(-1.0, 1.0, (200, 2)):
            assert flat.gap(x, y) == ground.gap(x, y)


def test_another_goal_has_the_only_mark(tmp_path):
    """Of a file's own goal nothing is left where the task's is elsewhere."""
    flat = in_file(tmp_path, room(), goal=(0.5, -0.3)).nominal.ground.world
    assert [(t.name, t.x, t.y) for t in flat.obstacles if t.is_goal] == [
        ("GOAL", 0.5, -0.3)
    ]
    assert len(flat.obstacles) == 3
    assert read_world(write_world(flat)).goal == (0.5, -0.3)


def test_a_solid_mark_of_another_goal_stays(tmp_path):
    """A mark that can be hit is an obstacle with another name."""
    solid = replace(room().obstacles[1], solid=room().obstacles[1].visible)
    world = room(obstacles=(room().obstacles[0], solid))
    flat = in_file(tmp_path, world, goal=(0.5, -0.3)).nominal.ground.world
    assert [t.name for t in flat.obstacles if t.solid] == ["post", "former mark", "two"]
    assert read_world(write_world(flat)) == flat


def test_a_start_without_heading_keeps_the_file_s(tmp_path):
    """Two numbers move the robot, three also turn it."""
    assert in_file(tmp_path, room(), start=(-0.5, 0.1)).nominal.start == (
        -0.5,
        0.1,
        0.3,
    )
    turned = in_file(tmp_path, room(), start=(-0.5, 0.1, -1.0)).nominal
    assert turned.start == (-0.5, 0.1, -1.0)


def test_dt_is_the_world_s_unless_given(tmp_path):
    """The file's basicTimeStep, or the task's own, which the flat world then has."""
    assert in_file(tmp_path, room(time_step=16.0)).nominal.dt == 0.016
    task = in_file(tmp_path, room(time_step=16.0), dt=0.02)
    assert task.nominal.dt == 0.02
    assert task.nominal.ground.world.time_step == 20.0


def test_what_is_not_modelled_is_refused_or_listed(tmp_path):
    """A node that may be solid is refused; left out by name, it is told for good."""
    (tmp_path / "w.wbt").write_text(write_world(room()) + LEGO)
    with pytest.raises(WorldError, match=r"LegoTallWall.*--ignore"):
        load_task(TaskFile(env=EPUCK.id, world="w.wbt"), base=tmp_path)
    for name in ("LegoTallWall", "north"):
        spec = TaskFile(env=EPUCK.id, world="w.wbt", ignore=(name,))
        task = load_task(spec, base=tmp_path)
        assert task.setting.left_out == ("LegoTallWall 'north' at (0.1, 0.7)",)
        folder = tmp_path / name
        write_workdir(folder, task)
        (folder / "task.yaml").write_text(portable_task_file(task))
        again = load_task(folder)
        assert again.setting.left_out == task.setting.left_out
        assert again.sha256() == task.sha256()
        assert again.sha256() != in_file(tmp_path, room()).sha256()
        (tmp_path / "w.wbt").write_text(write_world(room()) + LEGO)


def test_nodes_that_are_not_solid_need_no_word(tmp_path):
    """What cannot be hit is left out of the flat world without a word."""
    lamp = Unmodelled("lamp", "Lamp", 0.0, 0.0, "a light", may_be_solid=False)
    assert in_file(tmp_path, room(unmodelled=(lamp,))).setting.left_out == ()


@pytest.mark.parametrize(
    "changes",
    [
        {"start": (-0.6, 0.001, 0.3)},
        {"start": (-0.6, 0.0, 0.31)},
        {"goal": (0.6, 0.001)},
        {"tolerance": 0.021},
        {"dt": 0.016},
        {"horizon": 2501},
        {"progress": {"fraction": 0.6}},
    ],
)
def test_the_hash_tells_tasks_apart(tmp_path, changes):
    """Whatever decides an episode changes the task's hash."""
    assert in_file(tmp_path, room()).sha256() == in_file(tmp_path, room()).sha256()
    changed = in_file(tmp_path, room(), **changes).sha256()
    assert changed != in_file(tmp_path, room()).sha256()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"env": EPUCK.id, "map": "maze"}, "map: only valid with env: TDAC-Map2D-v0"),
        ({"env": EPUCK.id, "snap": True}, "snap: only valid with env: TDAC-Map2D-v0"),
        ({"world": "arena"}, "world: only valid with env: TDAC-EPuck-v0"),
        (
            {"map": "maze", "ignore": ["x"]},
            "ignore: only valid with env: TDAC-EPuck-v0",
        ),
        ({"env": "TDAC-Car-v0"}, "env: unknown environment .*known: TDAC-Map2D"),
        ({"env": EPUCK.id, "world": "arena", "ignore": ["x"]}, "no node called 'x'"),
        ({"env": EPUCK.id, "world": "nothing.wbt"}, "no such file"),
        (
            {"env": EPUCK.id, "goal": [0.0, 3.0]},
            r"the goal is outside the arena's wall, .* to \(1, 1\)",
        ),
        (
            {"env": EPUCK.id, "start": [1.5, 0.0, 0.0]},
            "the start is outside the arena's wall",
        ),
        ({"env": EPUCK.id, "start": [0.6, -0.38]}, "already at the goal"),
    ],
)
def test_a_file_that_makes_no_sense_is_refused(tmp_path, content, message):
    """One line says what is wrong, and where."""
    (tmp_path / "task.yaml").write_text(yaml.safe_dump(content))
    with pytest.raises((TaskError, WorldError), match=message):
        load_task(tmp_path)


def test_a_world_without_a_goal_asks_for_one(tmp_path):
    """The message says how to give it, and then it is a task."""
    bare = room(goal=None, obstacles=room().obstacles[:1])
    with pytest.raises(TaskError, match=r"w\.wbt names no goal: .*--goal X Y"):
        in_file(tmp_path, bare)
    assert in_file(tmp_path, bare, goal=(0.6, 0.0)).nominal.goal == (0.6, 0.0)


def test_a_world_without_an_e_puck_asks_for_its_place(tmp_path):
    """The message says how to give it, and then it is a task."""
    with pytest.raises(TaskError, match=r"w\.wbt has no e-puck in it: .*--start X Y"):
        in_file(tmp_path, room(robots=()))
    task = in_file(tmp_path, room(robots=()), start=(-0.6, 0.0, 0.3))
    assert task.nominal.start == (-0.6, 0.0, 0.3)
    assert write_world(task.nominal.ground.world).count("\nE-puck {") == 1


def test_range_noise_is_the_mean_of_the_published_one():
    """A relative noise is that of the sensors' table, on the average over it."""
    env = load_task("epuck").disturbed_env(Disturbance(range_noise=0.05))
    spread = env.sensor_noise * TABLE[:, 2]
    assert spread.mean() == pytest.approx(0.05)
    assert env.variation == "jitter"
    assert (env.wheel_slip, env.delay) == (0.03, 1)


@pytest.mark.parametrize("name", ["maze", "epuck"])
def test_a_preview_is_a_picture_of_the_task(name):
    """Start and goal are on it: it is another one where they are elsewhere."""
    task = load_task(name)
    picture = task.setting.preview()
    assert picture.dtype == np.uint8
    assert picture.shape[2] == 3
    spec = task.spec.model_copy(update={"goal": task.nominal.start[:2]})
    x, y = task.nominal.goal
    moved = load_task(spec.model_copy(update={"start": (x, y, 0.0)}))
    other = moved.setting.preview()
    assert other.shape != picture.shape or (other != picture).any()
