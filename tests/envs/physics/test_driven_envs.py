"""Promises of the environments whose robot MuJoCo moves."""

import math
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import tdac_envs.robots
from tdac_envs.core.errors import TaskError
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.map2d.env import Map2DEnv

pytest.importorskip("mujoco")


def bundled_robot_text(name):
    return (Path(tdac_envs.robots.__file__).parent / f"files/{name}.yaml").read_text()


def open_map(size=200):
    """An empty map of 1 cm per pixel with a wall of 5 px at its right end."""
    cells = np.zeros((size, size), bool)
    cells[:, -5:] = True
    return cells


def on_map(physics, **options):
    ends = {"start": (60.0, 100.0, 0.0), "goal": (150.0, 60.0)}
    env = Map2DEnv(open_map(), **{**ends, "physics": physics, **options})
    env.reset(seed=0)
    return env


def driven(env, action, steps):
    """All results of equal steps up to the end of the episode."""
    results = []
    for _ in range(steps):
        results.append(env.step(np.array(action, np.float32)))
        if results[-1][2] or results[-1][3]:
            break
    return results


@pytest.mark.parametrize("action", [(0.5, 0.5), (0.4, 0.2), (0.2, 0.4), (-0.2, 0.2)])
def test_on_a_map_left_is_left_and_the_way_is_nearly_the_same(action):
    """y is mirrored at the seam, and mirrored back."""
    here, there = (
        driven(on_map(physics), action, 20)[-1][0]["pose"]
        for physics in ("exact", "mujoco")
    )
    assert math.dist(here[:2], there[:2]) < 2.0
    assert abs(math.remainder(float(here[2] - there[2]), math.tau)) < 0.1


@pytest.mark.parametrize("physics", ["exact", "mujoco"])
def test_a_wall_at_full_speed_ends_the_episode_in_both(physics):
    env = on_map(physics, start=(150.0, 100.0, 0.0), goal=(60.0, 100.0))
    *_, (_, reward, terminated, _, info) = driven(env, (1.0, 1.0), 40)
    assert terminated
    assert info["collision"]
    assert reward < -9.0
    assert env.pose()[0] == pytest.approx(194.5 - env.task.body_radius, abs=0.5)


@pytest.mark.parametrize("physics", ["exact", "mujoco"])
def test_an_e_puck_at_a_wall_ends_the_episode_in_both(physics):
    env = EPuckEnv("corridor", physics=physics)
    env.reset(seed=0)
    results = driven(env, (0.9, 1.0), 300)
    assert results[-1][4]["collision"]
    assert results[-1][4]["clearance"] == pytest.approx(0.037, abs=2e-4)
    assert not any(result[4]["collision"] for result in results[:-1])


def test_the_first_observation_does_not_depend_on_the_physics():
    seen = [EPuckEnv("maze", physics=p).reset(seed=3)[0] for p in ("exact", "mujoco")]
    for key, value in seen[0].items():
        np.testing.assert_array_equal(value, seen[1][key])


def test_an_e_puck_pushes_what_has_a_mass():
    """The things of the env move, and the infra-red sensors see them there."""
    env = EPuckEnv("crates", physics="mujoco", on_collision="block")
    env.reset(seed=0)
    before = env.things()
    results = driven(env, (1.0, 0.95), 90)
    off = np.hypot(*(env.things() - before)[:, :2].T)
    assert off.max() > 0.01
    assert any(result[4]["collision"] for result in results)
    assert env.robot.readings.max() > 1000


def test_the_gap_watch_follows_the_driven_way():
    """The gap at the end of a step is the clearance without the radius."""
    env = EPuckEnv("corridor", physics="mujoco")
    _, info = env.reset(seed=0)
    watch = env.watch_gap()
    watch.note()
    begin = least = info["clearance"] - 0.037
    while info["clearance"] > 0.045:
        info = env.step(np.array([0.9, 1.0], np.float32))[4]
        watch.note()
        least = min(least, info["clearance"] - 0.037)
    assert 0.0 < least < 0.1 * begin
    assert watch.smallest().gap == pytest.approx(least, abs=1e-4)


def test_slow_motors_and_late_commands_work_as_without():
    """Lag and delay are applied before the physics: at first nothing moves."""
    env = EPuckEnv("arena", physics="mujoco", delay=3, motor_lag=0.1)
    env.reset(seed=0)
    begin = env.pose()
    results = driven(env, (1.0, 1.0), 6)
    assert math.dist(results[2][0]["pose"][:2], begin[:2]) < 1e-5
    assert math.dist(results[5][0]["pose"][:2], begin[:2]) > 1e-3


def test_wheel_gains_turn_the_robot():
    """A hidden gain of one wheel is in the motion, not in `wheel_speeds`."""
    turned = []
    for seed in range(4):
        env = EPuckEnv("arena", physics="mujoco", wheel_gains=0.2)
        env.reset(seed=seed)
        begin = env.pose()[2]
        seen = driven(env, (0.5, 0.5), 20)[-1][0]
        assert seen["wheel_speeds"].tolist() == [0.5, 0.5]
        turned.append(abs(env.pose()[2] - begin))
    assert max(turned) > 0.05


def test_each_episode_begins_anew():
    """Equal seeds give equal episodes, also after a contact with things."""
    env = EPuckEnv("crates", physics="mujoco")
    ways = []
    for _ in range(2):
        env.reset(seed=5)
        ways.append([result[0]["pose"] for result in driven(env, (1.0, 0.95), 70)])
    np.testing.assert_array_equal(*ways)


@pytest.mark.parametrize("name", ["TDAC-Map2D-v0", "TDAC-EPuck-v0"])
@pytest.mark.parametrize("physics", ["mujoko", "", None, 3])
def test_an_unknown_physics_is_refused_in_one_line(name, physics):
    with pytest.raises(TaskError, match=r"unknown physics .*; expected one of exact, "):
        gym.make(name, physics=physics)


@pytest.mark.parametrize(
    ("physics", "told"),
    [
        ({"engine": "mujoco", "tork": 1.0}, r"unknown key 'tork'.*'torque'"),
        ({"torque": 1.0}, "unknown physics ''"),
        ({"engine": "mujoco", "mass": -1.0}, "body: mass above 0, got -1"),
        ({"engine": "mujoco", "resolution": 0.0}, "resolution above 0"),
    ],
)
def test_a_wrong_figure_is_refused_in_one_line(physics, told):
    with pytest.raises(TaskError, match=told) as refused:
        Map2DEnv("office", physics=physics)
    assert "\n" not in str(refused.value)


def test_figures_of_the_body_change_the_motion():
    """Weak motors, and a smooth floor, make the start late."""
    driven_by = []
    for own in ({}, {"torque": 0.0004}, {"grip": 0.02}):
        env = EPuckEnv("arena", physics={"engine": "mujoco", **own})
        env.reset(seed=0)
        begin = env.pose()
        driven(env, (1.0, 1.0), 15)
        driven_by.append(math.dist(env.pose()[:2], begin[:2]))
    usual, weak, smooth = driven_by
    assert usual > 0.055
    assert weak < usual - 0.01
    assert smooth < usual - 0.01


def test_a_robot_file_has_figures_of_the_body(tmp_path):
    """And what the argument says overrides them; each figure has a source."""
    bundled = bundled_robot_text("e-puck")
    file = tmp_path / "weak.yaml"
    body = "body:\n  torque: 0.0004\n  mass: 0.2\n"
    source = '  body.torque: "measured"\n  body.mass: "measured"\n'
    file.write_text(body + bundled + source)
    env = EPuckEnv("arena", robot=file, physics="mujoco")
    assert env.setup.physics.body == {"torque": 0.0004, "mass": 0.2}
    total = env._movables.body.model.body_subtreemass[0]
    assert total == pytest.approx(0.2)
    env = EPuckEnv("arena", robot=file, physics={"engine": "mujoco", "torque": 0.01})
    assert env.setup.physics.body == {"torque": 0.01, "mass": 0.2}
    file.write_text(body + bundled)
    with pytest.raises(TaskError, match=r"no source of body.mass, body.torque"):
        EPuckEnv("arena", robot=file, physics="mujoco")


def test_a_map_is_as_large_as_its_resolution_says():
    env = Map2DEnv("office", physics={"engine": "mujoco", "resolution": 0.02})
    hull = env._carried.body.model.geom("hull")
    assert hull.size[0] == pytest.approx(0.02 * env.task.body_radius)


@pytest.mark.parametrize("name", ["TDAC-Map2D-v0", "TDAC-EPuck-v0"])
def test_a_batch_says_that_it_computes_the_exact_step(name):
    with pytest.raises(TaskError, match="or vectorization_mode='sync', got physics="):
        gym.make_vec(name, num_envs=2, physics="mujoco")
    envs = gym.make_vec(name, 2, vectorization_mode="sync", physics="mujoco")
    envs.reset(seed=0)
    assert envs.step(np.ones((2, 2), np.float32))[0]["pose"].shape == (2, 3)
    envs.close()


def test_movers_are_refused():
    with pytest.raises(TaskError, match="has no movers; leave them out"):
        Map2DEnv("office", physics="mujoco", movers="bounce:2")


def test_a_map_without_resolution_has_a_robot_of_ten_centimetres():
    env = Map2DEnv("office", physics="mujoco")
    hull = env._carried.body.model.geom("hull")
    assert hull.size[0] == pytest.approx(0.1)
