"""Tasks with movers: one identity, the same movers in all commands, clear refusals."""

import numpy as np
import pytest
import yaml
from small import write_small_task

from tdac_agent import load_task
from tdac_agent.environments.map2d.moving import sentence_on
from tdac_agent.prompting.prompt import PromptTemplate, generate_prompt
from tdac_agent.tasks.disturbance import Disturbance
from tdac_agent.tasks.task import lay_out
from tdac_agent.training.plan import make_batch, make_plan
from tdac_agent.verification.suite.starts import episode_seed, spread_starts
from tdac_envs.core.errors import TaskError
from tdac_envs.grid.map_units import MapFrame, MapUnits
from tdac_envs.map2d.metric_input import movers_in_pixels
from tdac_envs.movers.spec import read_specs

TWO = [{"kind": "bounce", "count": 2}]
POST = {"kind": "route", "points": [[100, 90]], "radius": 4}
# It stands near the start of the robot.
NEAR = {"kind": "route", "points": [[30, 43]], "radius": 4}


@pytest.fixture
def moving(tmp_path):
    """The small task with two movers, which say all in a text."""
    return load_task(write_small_task(tmp_path / "moving", movers="bounce:2"))


def test_movers_belong_to_the_task(moving, small_task, tmp_path):
    """A text and a list are the same task, which is not that without movers."""
    listed = load_task(write_small_task(tmp_path / "listed", movers=TWO))
    assert listed.sha256() == moving.sha256() != small_task.sha256()
    assert moving.without_movers().sha256() == small_task.sha256()
    assert "movers" not in small_task.setting.facts()


def test_a_run_folder_keeps_them(moving, tmp_path):
    """Its `task.yaml` is the same task."""
    folder = lay_out(moving, tmp_path / "run")
    assert load_task(folder).sha256() == moving.sha256()
    assert yaml.safe_load((folder / "task.yaml").read_text())["movers"] == TWO


def test_every_environment_of_the_task_has_them(moving):
    """That of the tests, and that of evaluations and robust verifications."""
    disturbance = Disturbance(0.0, 0.0, 0.0, 0)
    for env in (moving.make_env(), moving.disturbed_env(disturbance, "random")):
        env.reset(seed=1)
        assert env.movers.discs().shape == (2, 3)


def test_a_training_has_them(moving, tmp_path):
    """So has each robot of its batch."""
    pytest.importorskip("stable_baselines3")
    folder = lay_out(moving, tmp_path / "run")
    batch = make_batch(make_plan((str(folder),), n_envs=2), 2)
    batch.reset()
    discs = [batch.batch.unwrapped.movers(i).discs() for i in range(2)]
    assert [each.shape for each in discs] == [(2, 3)] * 2
    assert (discs[0] != discs[1]).any()


@pytest.mark.parametrize(
    ("movers", "words"),
    [
        ("crwd:3", "movers: unknown kind 'crwd' (did you mean 'crowd'?)"),
        ([{"kind": "bounce", "cuont": 2}], "movers: entry 0: cuont: unknown key"),
        ({"kind": "bounce"}, "movers: expected 'bounce:5' or"),
        ([POST | {"points": [[73, 40]]}], "mover 0: "),
        ([POST | {"points": [[30, 35]]}], "mover 0 starts on the robot"),
    ],
)
def test_movers_that_cannot_be(refused, tmp_path, movers, words):
    """A single line that names the key or the mover; exit code 2."""
    folder = write_small_task(tmp_path / "wrong", movers=movers)
    err = refused("synth", "--task", folder)
    assert words in err


def test_worlds_have_none(refused, tmp_path):
    """The key and the flag are only for maps."""
    file = tmp_path / "task.yaml"
    file.write_text("env: TDAC-EPuck-v0\nmovers: bounce:2\n")
    err = refused("synth", "--task", file)
    assert "movers: only valid with env: TDAC-Map2D-v0" in err
    err = refused("synth", "--world", "arena", "--movers", "bounce:2")
    assert "leave out --movers" in err


def test_the_flag(refused, done):
    """It is the key of a task on a map, and adds movers to one that has a name."""
    err = refused("synth", "--map", "maze", "--movers", "crwd:3")
    assert "--movers: unknown kind 'crwd'" in err
    words = ("synth", "--task", "maze", "--movers", "crowd:3", "--dry-run")
    out = done(*words)
    assert "a crowd of 3 people" in out


def test_movers_in_metres():
    """Places, lengths and headings are those of the map's frame."""
    units = MapUnits(MapFrame(100, 0.1, (0.0, 0.0, 0.0)))
    given = [
        {"kind": "bounce", "start": [1.05, 2.05], "heading": 0.5, "speed": 2},
        {"kind": "route", "points": [[1.05, 9.95], [2.05, 9.95]], "radius": 0.5},
    ]
    bounce, route = movers_in_pixels(read_specs(given), units)
    assert bounce.start == pytest.approx((10.0, 79.0))
    assert (bounce.heading, bounce.speed) == pytest.approx((-0.5, 20.0))
    assert bounce.radius is None
    assert np.allclose(route.points, [(10.0, 0.0), (20.0, 0.0)])
    assert route.radius == pytest.approx(5.0)


def test_prompts_say_so(moving, small_task):
    """In one sentence; without movers there is none."""
    sentence = sentence_on(moving.setting.movers)
    assert sentence.startswith("Beside the robot, 2 discs that bounce off walls move")
    for name in ("full", "underspecified"):
        template = PromptTemplate(name)
        assert generate_prompt(moving, (), template).count(sentence) == 1
        assert "Beside the robot" not in generate_prompt(small_task, (), template)


def test_a_jittered_start_is_one_where_an_episode_can_begin(tmp_path):
    """Starts that a given mover would soon touch are drawn again."""
    task = load_task(write_small_task(tmp_path / "near", movers=[NEAR]))
    wall = load_task(write_small_task(tmp_path / "far"))
    env = task.make_env()
    for start in spread_starts(task.nominal, 1, 5, task.start_check()):
        env.reset(seed=0, options={"start": start})
    seed = next(s for s in range(99) if _refused(env, wall, s))
    starts = spread_starts(task.nominal, seed, 5, task.start_check())
    assert starts != spread_starts(wall.nominal, seed, 5)


def _refused(env, task, seed):
    """Whether a jittered start without movers is one that movers forbid."""
    for start in spread_starts(task.nominal, seed, 5):
        try:
            env.reset(seed=0, options={"start": start})
        except TaskError:
            return True
    return False


def test_seeds_of_episodes():
    """Each start of each verification has its own, of any size of seed."""
    seeds = {episode_seed(seed, k) for seed in (0, 1, 2**127) for k in range(6)}
    assert len(seeds) == 18
    assert min(seeds) >= 0
