"""Promises of a robot that differs from its description, anew at each reset."""

import math
import pickle

import numpy as np
import pytest

from tdac_envs.core.errors import TaskError
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.physics.engine_choice import engine_of
from tdac_envs.physics.varied import (
    AS_DESCRIBED,
    AXLE,
    FRICTION,
    MASS,
    WHEELS,
    variation_at,
)

pytest.importorskip("mujoco")
from tdac_envs.physics.body import e_puck_body
from tdac_envs.physics.engine import MujocoBody
from tdac_envs.physics.scene import Scene

AXLE_LENGTH = 0.057


def body(varied=None):
    return MujocoBody(Scene(()), e_puck_body(0.16, AXLE_LENGTH).changed(varied=varied))


def turned(moved, left, right, steps=20):
    """Turn in equal steps of 0.05 s at full speed, rad: without the start."""
    for _ in range(4):
        moved.step(left, right, 0.05)
    angle, before = 0.0, moved.pose()[2]
    for _ in range(steps):
        now = moved.step(left, right, 0.05).pose[2]
        angle += math.remainder(now - before, math.tau)
        before = now
    return angle


def test_draws_fill_their_limits_and_follow_from_start_and_seed():
    found = [variation_at((0.01 * k, 0.0, 0.0), 3) for k in range(400)]
    for name, most in (("mass", MASS), ("grip", FRICTION), ("axle", AXLE)):
        errors = [getattr(each, name) - 1.0 for each in found]
        assert max(errors) <= most
        assert min(errors) >= -most
        assert np.mean(np.abs(errors)) == pytest.approx(most / 2, rel=0.1)
    wheels = np.array([each.wheels for each in found]) - 1.0
    assert np.abs(wheels).max() <= WHEELS
    assert abs(np.corrcoef(wheels.T)[0, 1]) < 0.2
    assert variation_at((0.0, 0.0, 0.0), 3) == variation_at((-0.0, 0.0, 0.0), 3)
    assert variation_at((0.0, 0.0, 0.0), 3) != variation_at((0.0, 0.0, 0.0), 4)
    assert variation_at((1.0, 2.0, 0.5), None) == AS_DESCRIBED


@pytest.mark.parametrize("seed", range(4))
def test_turns_are_those_of_the_drawn_axle_and_wheels(seed):
    """On the spot by the drawn axle; straight on, the larger wheel turns it away."""
    plain, other = body(), body(seed)
    for each in (plain, other):
        each.reset((0.0, 0.0, 0.0))
    left, right = other.variation.wheels
    expected = 0.5 * (left + right) / other.variation.axle
    ratio = turned(other, -0.05, 0.05) / turned(plain, -0.05, 0.05)
    assert ratio == pytest.approx(expected, abs=1e-4)
    other.reset((0.0, 0.0, 0.0))
    axle = AXLE_LENGTH * other.variation.axle
    assert turned(other, 0.1, 0.1) == pytest.approx(
        0.1 * (right - left) / axle, abs=1e-4
    )


def test_mass_and_frictions_are_the_drawn_ones_and_do_not_add_up():
    """After many resets the factors are still those of the description."""
    moved, plain = body(1), body()
    for k in range(5):
        moved.reset((0.1 * k, 0.0, 0.0))
    drawn = moved.variation
    total = moved.model.body_mass.sum() / plain.model.body_mass.sum()
    assert total == pytest.approx(drawn.mass)
    hull = moved.model.geom("hull").id
    assert moved.model.geom_friction[hull, 0] == pytest.approx(drawn.friction)


def test_equal_starts_are_equal_episodes_also_in_a_copy():
    env = EPuckEnv("crates", physics="mujoco-varied", variation="jitter")
    ends = []
    for _ in range(2):
        env.reset(seed=5)
        for _ in range(20):
            env.step(np.array([0.9, 1.0], np.float32))
        ends.append(env.pose())
    np.testing.assert_array_equal(*ends)
    twin = pickle.loads(pickle.dumps(env))
    for each in (env, twin):
        for _ in range(5):
            each.step(np.array([0.9, 1.0], np.float32))
    np.testing.assert_array_equal(env.pose(), twin.pose())
    other = EPuckEnv(
        "crates", physics={"engine": "mujoco", "varied": 9}, variation="jitter"
    )
    other.reset(seed=5)
    for _ in range(20):
        other.step(np.array([0.9, 1.0], np.float32))
    assert not np.array_equal(other.pose(), ends[0])


@pytest.mark.parametrize("seed", [-1, 1.5, "a", True])
def test_a_seed_that_is_none_is_refused(seed):
    with pytest.raises(TaskError, match="varied"):
        engine_of({"engine": "mujoco", "varied": seed}).body_like(
            e_puck_body(0.16, AXLE_LENGTH)
        )
