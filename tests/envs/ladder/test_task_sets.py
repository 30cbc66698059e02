"""A task set is the same for everybody, and its splits share no world."""

import numpy as np
import pytest
import yaml

from tdac_envs import load_set
from tdac_envs.core.errors import TaskError
from tdac_envs.ladder.random_stream import world_key
from tdac_envs.ladder.set_file import SetFile, set_names
from tdac_envs.map2d.task import make_task

SALT = b"0123456789abcdef"


@pytest.fixture
def set_yaml(tmp_path):
    """Writes a `set.yaml` with these values and returns its path."""

    def write(**values):
        path = tmp_path / "mine.yaml"
        path.write_text(yaml.safe_dump({"worlds": [{"name": "aisles"}], **values}))
        return path

    return write


def test_the_easiest_is_first():
    """Those in pixels, then those in metres."""
    names = "known", "unknown", "lost", "moving", "crowd", "epuck", "floor"
    assert set_names() == names


@pytest.mark.slow_after(2)
@pytest.mark.parametrize("name", set_names())
def test_a_world_follows_from_set_split_and_number(name):
    one, again = load_set(name), load_set(name)
    task, same = one.task("dev", 3), again.task("dev", 3)
    assert np.array_equal(task.field, same.field)
    assert (task.start, task.goal, task.horizon) == (
        same.start,
        same.goal,
        same.horizon,
    )
    others = [one.task("dev", 8), one.task("test", 3), one.task("hidden", 3, SALT)]
    assert not any(np.array_equal(task.field, other.field) for other in others)


def test_a_task_is_that_of_a_map():
    """TDAC-Map2D-v0 takes the world, and finds the same path length."""
    tasks = load_set("unknown")
    task = tasks.task("test", 1)
    made = make_task(
        task.terrain,
        task.start,
        task.goal,
        task.robot,
        dt=task.dt,
        goal_tolerance=task.goal_tolerance,
        horizon=task.horizon,
    )
    assert made.shortest == pytest.approx(task.shortest)
    assert np.array_equal(made.field, task.field)


def test_horizon_and_slip():
    """16 OT within 400 and 2,000 steps; slip for another step has the same drift."""
    file = load_set("lost").file
    assert [file.horizon.steps(ot) for ot in (10, 60.01, 200)] == [400, 961, 2000]
    assert file.slip == pytest.approx(file.disturbances.wheel_slip)
    half = file.model_copy(update={"dt": 0.05})
    assert half.slip == pytest.approx(file.slip * 2**0.5)


def test_generators_take_turns():
    file = load_set("unknown").file
    names = [file.spec(index).generator.name for index in range(6)]
    assert names == ["mazes", "rooms", "caves", "clutter", "aisles", "mazes"]


def test_the_hash_covers_all_but_the_description(set_yaml):
    one = load_set(set_yaml()).sha256
    assert load_set(set_yaml(description="Another text.")).sha256 == one
    assert load_set(set_yaml(dt=0.1)).sha256 == one  # the default
    assert load_set(set_yaml(dt=0.2)).sha256 != one
    assert load_set(set_yaml(name="other")).sha256 != one


def test_the_key_is_that_of_the_words():
    tasks = load_set("unknown")
    key = tasks.key("hidden", 7, "noise", SALT)
    assert key == world_key(SALT, tasks.sha256, "hidden", 7, "noise")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("dve", 0), r"unknown split 'dve'; .* \(did you mean 'dev'\?\)"),
        (("hidden", 0), "split 'hidden' needs a salt"),
        (("hidden", 0, b"short"), "the salt has 5 bytes; expected 16 to 4096"),
        (("dev", 0, SALT), "split 'dev' has a public salt"),
        (("dev", -1), "expected index"),
        (("dev", 1.5), "expected index"),
    ],
)
def test_worlds_that_do_not_exist(arguments, message):
    with pytest.raises(TaskError, match=message):
        load_set("unknown").world(*arguments)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"worlds": []}, "worlds: "),
        ({"worlds": [{"name": "moon"}]}, "worlds.0: .*'moon'"),
        ({"dt": 0}, "dt: "),
        ({"observe": ["pose"]}, r"observe: .*\(did you mean 'observed'\?\)"),
        ({"observed": ["pose", "pose"]}, "observed: expected each key once"),
        ({"observed": ["gps"]}, "observed.0: "),
        ({"map": True}, "a set with `map: true` needs `frame: map`"),
        ({"disturbances": {"odometry_noise": 0.1}}, "need `odometry` in `observed`"),
        (
            {"horizon": {"least": 9, "most": 8}},
            "`least` to be at most `most`, got 9 and 8",
        ),
        ({"name": "a/b"}, "name: "),
        ({"schema": 2}, "schema: "),
        ({"robot": {"radius": 0}}, "robot: radius: expected more than 0, got 0"),
        ({"robot": {"kind": "turtle"}}, r"robot: kind: "),
        (
            {"disturbances": {"wheelslip": 0.1}},
            r"did you mean 'wheel_slip'",
        ),
        ({"worlds": [{"name": "mazez"}]}, "unknown name 'mazez'; expected one of"),
        ({"movers": "crowd:20"}, "movers: expected a list"),
        ({"movers": [{"kind": "bounce", "count": "x"}]}, "movers.0.count: "),
    ],
)
def test_files_that_are_refused(set_yaml, values, message):
    path = set_yaml(**values)
    with pytest.raises(TaskError, match=message) as caught:
        load_set(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_a_number_stands_for_both_ends(set_yaml):
    """Of the numbers that are drawn for each world."""
    movers = {"kind": "bounce", "count": 3, "speed": 15, "radius": [4, 6]}
    (group,) = load_set(set_yaml(movers=[movers])).file.movers
    assert (group.count, group.speed, group.radius) == ((3, 3), (15, 15), (4, 6))


def test_a_folder_is_the_set_that_is_in_it(tmp_path):
    """Its name is that of the folder."""
    place = tmp_path / "narrow"
    place.mkdir()
    (place / "set.yaml").write_text("worlds: [{name: mazes}]\n")
    assert load_set(place).name == load_set(place / "set.yaml").name == "narrow"


def test_unknown_sets(tmp_path):
    with pytest.raises(
        TaskError, match="expected the name or path of a task set, got 3"
    ):
        load_set(3)
    with pytest.raises(TaskError, match=r"'unkown'; .* \(did you mean 'unknown'\?\)"):
        load_set("unkown")
    with pytest.raises(TaskError, match=r"no\.yaml: No such file"):
        load_set(tmp_path / "no.yaml")
    (tmp_path / "list.yaml").write_text("- 1\n")
    with pytest.raises(TaskError, match="expected keys with values"):
        load_set(tmp_path / "list.yaml")


def test_a_set_without_a_feasible_world(set_yaml):
    """It says so after the tries that the set allows."""
    path = set_yaml(admission={"gap": 10, "tries": 5})
    with pytest.raises(TaskError, match="'mine', world 4: no feasible world from 5"):
        load_set(path).world("train", 4)


def test_built_in_sets_have_every_generator_once():
    for name in ("known", "unknown", "lost"):
        generators = [each.name for each in load_set(name).file.worlds]
        assert len(set(generators)) == len(generators) == 5
    assert isinstance(load_set("known").file, SetFile)


def test_a_task_of_plates_is_that_of_a_world():
    """TDAC-EPuck-v0 drives it: from the e-puck of the world to its goal."""
    tasks = load_set("epuck")
    world = tasks.world("test", 1)
    task, robot = tasks.task_of(world), world.world.robots[0]
    assert task.ground.world is world.world
    assert task.start[:2] == (robot.x, robot.y)
    assert task.goal == world.world.goal
    assert task.horizon == tasks.file.horizon.steps(world.difficulty.steps)
    assert task.full_step == pytest.approx(tasks.file.full_step)
    # The figures are lower bounds; grid paths are longer.
    assert world.difficulty.length <= task.shortest


EPUCK = {"worlds": [{"name": "plates"}], "robot": {"kind": "epuck"}}


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        ({**EPUCK, "robot": {"radius": 8, "axle_length": 11}}, "go together"),
        ({"robot": {"kind": "epuck"}, "goal_tolerance": 0.08}, "go together"),
        ({**EPUCK, "observed": ["goal", "ranges"]}, "an e-puck does not observe"),
        ({"observed": ["goal", "ps"]}, "a robot on maps does not observe `ps`"),
        ({**EPUCK, "map": True, "frame": "map"}, "without a map"),
        (
            {**EPUCK, "observed": ["ps"], "disturbances": {"range_noise": 0.1}},
            "an e-puck has no ranges",
        ),
    ],
)
def test_worlds_and_observations_are_those_of_the_robot(set_yaml, values, problem):
    with pytest.raises(TaskError, match=problem):
        load_set(set_yaml(**values))
