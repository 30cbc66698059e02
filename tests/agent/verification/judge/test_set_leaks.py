"""Nothing tells a controller which world of a task set it is in, but its observations.

A spy reports all that its process holds: its folder, its surroundings, and every text
and number that can be reached from modules, frames and the garbage collector.
"""

import contextlib
import hashlib
import json

import pytest

from tdac_agent.problems.episodes import episodes_of
from tdac_agent.problems.part import Part
from tdac_agent.verification.judge.child_pool import ChildPool
from tdac_agent.verification.judge.episode_job import opened
from tdac_agent.verification.judge.policy_spec import PolicySpec
from tdac_agent.verification.judge.worlds import Program
from tdac_envs import load_set
from tdac_envs.ladder.set_file import set_names

SALT = b"a salt that nobody may see"
WORLDS = (70_001, 70_002)
SPY = b"""
import random, sys
os = getattr(random, "_" + "os")  # the static tests are easily deceived
import gc

kept = []

def policy(obs):
    return 0.0, 0.0

def listed(folder):
    try:
        return sorted(os.listdir(folder))
    except OSError as error:  # some tiers show no other folder
        return type(error).__name__

def around():
    files = {}
    for name in os.listdir("."):
        status = os.stat(name)
        with open(name, "rb") as file:
            files[name] = file.read(), status.st_mtime, status.st_mode
    return {
        "files": files,
        "folder": (os.getcwd(), os.stat(".").st_mtime, listed("..")),
        "scratch": listed(os.environ["TMPDIR"]),
        "argv": list(sys.argv),
        "environment": dict(os.environ),
        "hash": hash("a text"),
        "flags": str(sys.flags),
        "path": list(sys.path),
        "modules": sorted(sys.modules),
    }

def reached():
    frame, todo = sys._getframe(), [sys.modules, *gc.get_objects()]
    while frame is not None:
        todo += [frame.f_locals, frame.f_globals]
        frame = frame.f_back
    known, texts = set(), set()
    while todo:
        value = todo.pop()
        if id(value) in known:
            continue
        known.add(id(value))
        if type(value) in (str, bytes, int, float):
            texts.add(value[:300] if type(value) is str else repr(value)[:300])
        else:
            kept.append(value)
            todo += gc.get_referents(value)
    return list(texts)
"""


@pytest.fixture(scope="module")
def child_pool():
    with ChildPool() as pool:
        yield pool


def watched(name, folder, child_pool, index):
    """What a spy finds after the first step in a hidden world.

    Returns:
        Its surroundings, the texts that it reached, the world's observation, a function
        that replaces the random name of the folder, and the ids of the process.
    """
    tasks = load_set(name)
    (folder / "a.salt").write_bytes(SALT)
    episodes = episodes_of(tasks)
    part = Part(WORLDS, "hidden", folder / "a.salt")
    worlds = opened(episodes.worlds(part, folder, PolicySpec("controller")))
    child = child_pool.take("auto", episodes.limits)
    with contextlib.closing(child):
        worlds.supply(child, index, Program(SPY))
        driver = worlds.load(child)
        seen, _ = worlds.env.reset(options={"index": index})
        driver.reset(seen)
        driver.policy(seen)
        around, texts = child.call("around"), set(child.call("reached"))
        own = child.folder.root.name  # random, and its only difference

    def same(value):
        return value.replace(own, "FOLDER") if type(value) is str else value

    process = {str(number) for number in (child.pid, child.controller_pid)}
    assert any(own in text for text in texts), "the spy has not seen its own folder"
    return around, set(map(same, texts)), seen, same, process


@pytest.mark.slow
@pytest.mark.parametrize("name", set_names())
def test_two_worlds_differ_by_map_and_observation_alone(name, tmp_path, child_pool):
    """No text, number, time, variable or path in the process tells a world."""
    first = watched(name, tmp_path, child_pool, WORLDS[0])
    other = watched(name, tmp_path, child_pool, WORLDS[1])
    assert not all((first[2][key] == other[2][key]).all() for key in first[2])
    texts = [json.dumps({**each[0], "files": 0}) for each in (first, other)]
    assert first[3](texts[0]) == other[3](texts[1])
    files = [each[0]["files"] for each in (first, other)]
    expected = {"controller.py", "params.json"}
    expected |= {"occupancy.npy"} if load_set(name).file.map else set()
    assert files[0].keys() == files[1].keys() == expected
    for file in expected - {"occupancy.npy"}:
        assert files[0][file] == files[1][file]
    for file in expected:
        assert files[0][file][1:] == files[1][file][1:]
        assert files[0][file][1] == 0.0
    assert first[1] ^ other[1] <= first[4] | other[4]


@pytest.mark.parametrize("name", set_names())
def test_neither_split_nor_number_nor_hash_is_in_the_process(
    name, tmp_path, child_pool
):
    """Not in the environment or a file either; the set's name is not told."""
    around, texts, *_ = watched(name, tmp_path, child_pool, WORLDS[0])
    tasks = load_set(name)
    secret = [SALT.decode(), SALT.hex(), hashlib.sha256(SALT).hexdigest()]
    secret += [tasks.sha256, str(tmp_path), str(WORLDS[0])]
    secret += [tasks.key("hidden", WORLDS[0], "world", SALT).hex()]
    everything = [*texts, repr(around)]
    assert not [word for word in secret if any(word in text for text in everything)]
    assert not {"hidden", "split", "seed=", tasks.name} & set(
        json.loads(around["files"]["params.json"][0])
    )
    assert "hidden" not in texts
