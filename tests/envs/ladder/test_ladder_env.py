"""TDAC-Ladder-v0: new worlds, nothing that leaks, equal alone and in a batch."""

import itertools
import json
import pickle
import shutil
import warnings
from dataclasses import asdict

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from tdac_envs import load_set
from tdac_envs.core.errors import TaskError
from tdac_envs.core.salt import read_salt
from tdac_envs.ladder.pool import TrainingPool, pool_folder
from tdac_envs.ladder.set_file import set_names

KEYS = {
    "known": {"pose", "goal", "wheel_speeds", "ranges"},
    "unknown": {"pose", "goal", "wheel_speeds", "ranges"},
    "lost": {"goal", "wheel_speeds", "ranges", "odometry"},
    "moving": {"pose", "goal", "wheel_speeds", "ranges"},
    "crowd": {"pose", "goal", "wheel_speeds", "ranges"},
    "epuck": {"goal", "wheel_speeds", "ps", "encoders"},
    "floor": {"pose", "goal", "wheel_speeds", "ranges"},
}
LEVELS = sorted(KEYS)


@pytest.fixture(autouse=True)
def _own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def make(level="unknown", split="dev", **options):
    return gym.make("TDAC-Ladder-v0", level=level, split=split, **options)


def driven(env, steps, seed=0):
    """Observations, rewards and infos of random actions; begins anew at an end."""
    random, told = np.random.default_rng(seed), []
    for _ in range(steps):
        action = random.uniform(-0.3, 1.0, 2).astype(np.float32)
        seen, reward, terminated, truncated, info = env.step(action)
        told.append((seen, reward, terminated, truncated, info))
        if terminated or truncated:
            break
    return told


def same(one, other):
    return one.keys() == other.keys() and all(
        np.array_equal(one[key], other[key]) for key in one
    )


def test_levels():
    assert set(set_names()) == set(KEYS)


@pytest.mark.slow
@pytest.mark.parametrize("level", LEVELS)
def test_gymnasium_finds_nothing_wrong(level):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(make(level).unwrapped, skip_render_check=True)


@pytest.mark.parametrize("level", LEVELS)
def test_spaces_are_those_of_the_level(level):
    """Not of a world."""
    spaces = [make(level, split).observation_space for split in ("dev", "test")]
    assert spaces[0] == spaces[1]
    assert set(spaces[0].keys()) == KEYS[level]


@pytest.mark.parametrize("level", LEVELS)
def test_nothing_leaks(level):
    """Every entry of every info and observation is on the list."""
    env = make(level, "test")
    for index in range(3):
        seen, info = env.reset(seed=index, options={"index": index})
        assert set(info) == {"collisions", "clipped"}
        assert set(seen) == KEYS[level]
        told = driven(env, 2000, index)
        for _, _, terminated, truncated, info in told:
            ended = {"is_success", "collision"} if terminated or truncated else set()
            assert set(info) == {"collisions", "clipped"} | ended
        assert terminated or truncated


@pytest.mark.parametrize("split", ["train", "dev", "test", "hidden"])
@pytest.mark.parametrize("level", ["unknown", "epuck"])
def test_a_reset_names_the_world(level, split, tmp_path):
    """By index, generator and difficulty, and only where worlds are no secret."""
    (tmp_path / "salt").write_bytes(b"0123456789abcdef")
    salt = {"salt_file": tmp_path / "salt"} if split == "hidden" else {}
    env, tasks = make(level, split, **salt), load_set(level)
    for _ in range(2):  # a training world is then read from its file
        info = env.reset(seed=1, options={"index": 3})[1]
        if split in ("test", "hidden"):
            assert set(info) == {"collisions", "clipped"}
            continue
        about = {
            "world_index": 3,
            "generator": tasks.kind(split, 3),
            "difficulty": asdict(tasks.world(split, 3).difficulty),
        }
        assert info == {"collisions": 0, "clipped": 0, **about}
        assert json.loads(json.dumps(info)) == info
        assert set(env.step(np.zeros(2, np.float32))[4]) == {"collisions", "clipped"}
        env = pickle.loads(pickle.dumps(env))


def test_a_batch_names_the_worlds_that_begin():
    """Those of the reset mask alone, or of the episodes that begin in a step."""
    batch = gym.make_vec(
        "TDAC-Ladder-v0", 2, level="unknown", split="dev", max_episode_steps=1
    )
    first = batch.reset(seed=1)[1]
    assert first["_world_index"].all()
    mask = np.array([False, True])
    again = batch.reset(seed=1, options={"reset_mask": mask, "index": 4})[1]
    assert again["world_index"][1] == 4
    assert np.array_equal(again["_world_index"], mask)
    still = np.zeros((2, 2), np.float32)
    assert "world_index" not in batch.step(still)[4]
    assert batch.step(still)[4]["_generator"].all()


def test_privileged_infos():
    env = make("lost", privileged=True)
    env.reset(seed=1)
    info = driven(env, 1)[0][-1]
    assert {"distance_to_goal", "path_distance", "clearance", "pose"} < set(info)
    assert np.array_equal(info["pose"], env.unwrapped.pose())


def test_without_a_map_the_frame_is_at_the_start():
    env = make("unknown")
    seen, _ = env.reset(seed=3)
    assert seen["pose"].tolist() == [0.0, 0.0, 0.0]
    task = env.unwrapped.task
    straight = np.subtract(task.goal, task.start[:2])
    assert np.hypot(*seen["goal"]) == pytest.approx(np.hypot(*straight), rel=1e-6)
    goal = seen["goal"]
    seen = env.step(np.full(2, 0.01, np.float32))[0]
    assert np.allclose(seen["pose"], [0.03, 0.0, 0.0], atol=1e-6)
    assert np.array_equal(seen["goal"], goal)
    for _ in range(5):
        ((seen, *_),) = driven(env, 1)
        x, y, heading = env.unwrapped.pose()
        cosine, sine = np.cos(task.start.heading), np.sin(task.start.heading)
        dx, dy = x - task.start.x, y - task.start.y
        place = [cosine * dx + sine * dy, cosine * dy - sine * dx]
        assert np.allclose(seen["pose"][:2], place, atol=1e-4)
        turned = seen["pose"][2] - (heading - task.start.heading)
        assert np.cos(turned) == pytest.approx(1.0)


def test_with_a_map_the_frame_is_that_of_the_map():
    env = make("known")
    seen, _ = env.reset(seed=3)
    task = env.unwrapped.task
    assert np.allclose(seen["pose"], task.start)
    assert seen["goal"].tolist() == list(task.goal)
    assert env.unwrapped.given_map() is task.terrain.grid.cells
    assert make("unknown").unwrapped.given_map() is None


def test_an_index_chooses_a_world_and_a_seed_draws_one():
    env, tasks = make("known"), load_set("known")
    env.reset(options={"index": 5})
    cells = tasks.task("dev", 5).terrain.grid.cells
    assert np.array_equal(env.unwrapped.given_map(), cells)
    first = env.reset(seed=8)[0]
    other = env.reset()[0]
    assert same(env.reset(seed=8)[0], first)
    assert same(env.reset()[0], other)
    assert not same(first, other)


def test_unknown_options():
    with pytest.raises(TaskError, match=r"unknown reset options \['start'\]"):
        make().reset(options={"start": (1, 2)})
    with pytest.raises(TaskError, match="index"):
        make().reset(options={"index": -1})


@pytest.mark.parametrize(("split", "equal"), [("dev", True), ("train", False)])
def test_what_the_disturbances_follow_from(split, equal):
    """The world; in training, the seed."""
    env = make("lost", split)
    env.reset(seed=1, options={"index": 2})
    one = driven(env, 20)
    env.reset(seed=2, options={"index": 2})
    other = driven(env, 20)
    assert all(same(a[0], b[0]) for a, b in zip(one, other, strict=True)) is equal


def test_a_pickled_environment_goes_on():
    env = make("lost").unwrapped
    env.reset(seed=4)
    copy = pickle.loads(pickle.dumps(env))
    one, other = driven(env, 20), driven(copy, 20)
    assert all(same(a[0], b[0]) for a, b in zip(one, other, strict=True))


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("level", sorted(LEVELS, key=lambda name: name != "lost"))
@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("privileged", [False, True])
def test_a_batch_is_many_of_one(level, mode, privileged):
    """Equal to Gymnasium's `SyncVectorEnv` to the bit, over several episodes."""
    modes = gym.vector.AutoresetMode(mode)
    options = {"level": level, "split": "dev", "privileged": privileged}
    batch = gym.make_vec("TDAC-Ladder-v0", num_envs=3, autoreset_mode=modes, **options)
    alone = gym.vector.SyncVectorEnv(
        [lambda: gym.make("TDAC-Ladder-v0", **options)] * 3, autoreset_mode=modes
    )
    assert batch.single_observation_space == alone.single_observation_space
    random, ends = np.random.default_rng(0), 0
    results = [env.reset(seed=7) for env in (batch, alone)]
    check_equal(*results)
    while ends < 3:
        actions = random.uniform(-0.2, 1.0, (3, 2)).astype(np.float32)
        results = [env.step(actions) for env in (batch, alone)]
        check_equal(*results)
        ends += int((results[0][2] | results[0][3]).sum())


def check_equal(one, other):
    """Equal nested results; of masked entries only those within the mask."""
    if isinstance(one, tuple):
        assert len(one) == len(other)
        for a, b in zip(one, other, strict=True):
            check_equal(a, b)
    elif isinstance(one, dict):
        assert one.keys() == other.keys()
        for key in one:
            check_equal(one[key], other[key])
    elif isinstance(one, np.ndarray) and one.dtype == object:
        for a, b in zip(one, other, strict=True):
            assert (a is None) == (b is None)
            if a is not None:
                check_equal(a, b)
    else:
        assert np.array_equal(one, other), (one, other)


def test_a_kept_world_is_the_world_that_was_made():
    tasks = load_set("unknown")
    made = tasks.task("train", 6)
    first, later = (TrainingPool(tasks).task(6) for _ in range(2))
    folder = pool_folder(tasks.sha256)
    assert [path.name for path in folder.iterdir()] == ["6.bin"]
    for kept, name in itertools.product((first, later), ("clear", "leaps")):
        one, other = (getattr(task.terrain, name) for task in (kept, made))
        assert np.array_equal(one, other)
        assert not one.flags.writeable
    for kept in (first, later):
        assert np.array_equal(kept.terrain.grid.cells, made.terrain.grid.cells)
        assert np.array_equal(kept.field, made.field)
        plain = ("start", "goal", "horizon", "shortest", "goal_tolerance", "dt")
        for name in plain:
            assert getattr(kept, name) == getattr(made, name)


@pytest.mark.parametrize("damage", [b"", b"nothing", None])
def test_a_damaged_file_is_made_anew(damage):
    tasks = load_set("unknown")
    made = tasks.task("train", 0)
    TrainingPool(tasks).task(0)
    path = pool_folder(tasks.sha256) / "0.bin"
    whole = path.read_bytes()
    broken = bytearray(whole)
    broken[-9] ^= 1
    path.write_bytes(bytes(broken) if damage is None else damage)
    again = TrainingPool(tasks).task(0)
    assert np.array_equal(again.field, made.field)
    assert path.read_bytes() == whole


def test_a_drawn_world_stays_at_hand():
    """The same task again, also after its file is gone; a copy has the same world."""
    tasks = load_set("unknown")
    pool = TrainingPool(tasks)
    task = pool.task(2)
    (pool_folder(tasks.sha256) / "2.bin").unlink()
    assert pool.task(2) is task
    assert np.array_equal(task.field, tasks.task("train", 2).field)
    copy = pickle.loads(pickle.dumps(pool))
    assert len(pickle.dumps(pool)) < 100_000
    assert np.array_equal(copy.task(2).field, task.field)


def test_worlds_of_another_version_are_removed():
    """Each version of the code would leave gigabytes; other folders are kept."""
    tasks = load_set("unknown")
    folder = pool_folder(tasks.sha256)
    older = folder.with_name(f"{folder.name[:16]}-{'0' * 16}")
    shutil.copytree(folder, older)
    own = folder.with_name("notes")
    own.mkdir()
    assert pool_folder(tasks.sha256) == folder
    assert older.exists()  # the next start of this version finds its folder
    other = pool_folder(load_set("known").sha256)
    assert {path.name for path in folder.parent.iterdir()} == {
        folder.name, other.name, own.name
    }  # fmt: skip


def test_room_is_left_on_the_disk(monkeypatch):
    """Worlds are then made each time."""
    tasks = load_set("unknown")
    monkeypatch.setattr("tdac_envs.ladder.pool._LEAST_FREE", 10**18)
    task = TrainingPool(tasks).task(3)
    assert np.array_equal(task.field, tasks.task("train", 3).field)
    assert not list(pool_folder(tasks.sha256).iterdir())


def test_without_a_cache_worlds_are_made_each_time(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    tasks = load_set("unknown")
    assert pool_folder(tasks.sha256) is None
    task = TrainingPool(tasks).task(1)
    assert np.array_equal(task.field, tasks.task("train", 1).field)


def test_a_pool_is_finite_and_no_pool_is_not():
    few = make(split="train", train_pool=2)
    goals = {tuple(few.reset(seed=seed)[0]["goal"]) for seed in range(8)}
    assert len(goals) == 2
    many = make(split="train", train_pool=0)
    goals = {tuple(many.reset(seed=seed)[0]["goal"]) for seed in range(4)}
    assert len(goals) == 4
    with pytest.raises(TaskError, match="train_pool"):
        make(train_pool=-1)


@pytest.mark.parametrize("level", ["unknown", "moving", "epuck"])
def test_training_may_begin_nearer_to_the_goal(level):
    """At any distance up to the world's own, feasible, and apart from movers."""
    own = make(level, split="train", train_pool=2)
    near = make(level, split="train", train_pool=2, nearer_starts=1.0)
    far = {}
    for index in range(2):
        own.reset(options={"index": index})
        near.reset(options={"index": index})
        task = own.unwrapped.task
        assert near.unwrapped.task.start == task.start
        far[task.goal] = task.shortest
    shares = []
    for seed in range(40):
        near.reset(seed=seed)
        task = near.unwrapped.task
        shares.append(task.shortest / far[task.goal])
        assert near.step(np.zeros(2, np.float32))[4]["collisions"] == 0
    assert max(shares) <= 1.1
    assert min(shares) < 0.35
    assert max(shares) > 0.65
    again = make(level, split="train", train_pool=2, nearer_starts=1.0)
    again.reset(seed=39)
    assert again.unwrapped.task.start == task.start


def test_nearer_starts_are_for_training():
    with pytest.raises(TaskError, match="is for the split 'train', not for 'dev'"):
        make(split="dev", nearer_starts=0.5)
    with pytest.raises(TaskError, match="expected nearer_starts from 0 to 1, got 2"):
        make(split="train", nearer_starts=2)


def test_hidden_worlds_need_a_salt(tmp_path):
    with pytest.raises(TaskError, match="split 'hidden' needs a salt"):
        make(split="hidden")
    with pytest.raises(TaskError, match=r"salt file .*no\.salt: No such file"):
        make(split="hidden", salt_file=tmp_path / "no.salt")
    (tmp_path / "a.hex").write_text("no digits")
    with pytest.raises(TaskError, match=r"a\.hex: expected hexadecimal digits"):
        make(split="hidden", salt_file=tmp_path / "a.hex")
    (tmp_path / "a.hex").write_text(f"{bytes(32).hex()}\n")
    assert read_salt(tmp_path / "a.hex") == bytes(32)
    goals = []
    for number in range(2):
        path = tmp_path / f"{number}.salt"
        path.write_bytes(bytes([number]) * 32)
        env = make(split="hidden", salt_file=path)
        goals.append(tuple(env.reset(options={"index": 0})[0]["goal"]))
    assert goals[0] != goals[1]


def test_a_batch_draws_its_pictures():
    batch = gym.make_vec(
        "TDAC-Ladder-v0", num_envs=2, split="dev", render_mode="rgb_array"
    )
    batch.reset(seed=0)
    frames = batch.render()
    assert len(frames) == 2
    assert frames[0].std() > 0
    assert not np.array_equal(*frames)
