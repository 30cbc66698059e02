"""`sensor="sonar"`: beams, and echoes that do not come back."""

import math

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import tdac_envs
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.map2d.vector import Map2DVectorEnv

SIDE, AT = 300, (150.0, 150.0)


def half_plane(turn):
    """A wall 60 px ahead of `AT` whose normal is `turn` off the line of sight."""
    y, x = np.mgrid[:SIDE, :SIDE]
    ahead = (x - AT[0] - 60) * math.cos(turn) + (y - AT[1]) * math.sin(turn)
    return ahead >= 0


def one_sonar(cells, heading=0.0, **more):
    """A single sonar that looks along the heading, without noise."""
    options = {"range_noise": 0.0, "n_rays": 1, "range_max": 120.0, **more}
    return Map2DEnv(
        cells, (*AT, heading), (100.0, 150.0), robot_radius=4, sensor="sonar", **options
    )


@pytest.mark.parametrize("turn", np.radians([0, 10, 20, 30, 36, -36, 27]))
def test_a_wall_is_heard_up_to_the_largest_incidence(turn):
    """The nearest ray of the beam of 30 degrees that comes back, as geometry says."""
    heard = float(one_sonar(half_plane(turn)).reset()[0]["ranges"][0])
    rays = np.radians(np.linspace(-15, 15, 9))
    echoes = [
        60 * math.cos(turn) / math.cos(ray - turn)
        for ray in rays
        if abs(ray - turn) <= math.radians(22.5)
    ]
    assert heard == pytest.approx(min(echoes, default=120.0), abs=2.5)


@pytest.mark.parametrize("turn", np.radians([42, 60, -50]))
def test_a_slanted_wall_is_lost(turn):
    """No ray of the beam meets it at less than 22.5 degrees from its normal."""
    cells = half_plane(turn)
    assert one_sonar(cells).reset()[0]["ranges"][0] == 120.0
    rays = Map2DEnv(
        cells, (*AT, 0.0), (100.0, 150.0), robot_radius=4, n_rays=1, range_max=120.0
    )
    assert rays.reset()[0]["ranges"][0] == pytest.approx(60.0, abs=1.0)


@pytest.mark.parametrize("heading", [0.0, 0.2])
def test_a_mover_is_heard_from_its_nearest_place(heading):
    """A disc reflects where its surface faces the sensor."""
    mover = [{"kind": "route", "points": [[210.0, 150.0]], "radius": 10.0, "speed": 0}]
    env = one_sonar(np.zeros((SIDE, SIDE), bool), heading, movers=mover)
    assert env.reset()[0]["ranges"][0] == pytest.approx(50.0, abs=0.2)
    away = one_sonar(np.zeros((SIDE, SIDE), bool), 0.6, movers=mover)
    assert away.reset()[0]["ranges"][0] == 120.0


def test_the_noise_is_relative():
    env = Map2DEnv("office", sensor="sonar")
    seen = np.array([env.reset(seed=k)[0]["ranges"] for k in range(300)], float)
    exact = Map2DEnv("office", sensor="sonar", range_noise=0.0).reset()[0]["ranges"]
    near = exact < 180
    assert near.any()
    spread = (seen / exact)[:, near].std(axis=0)
    assert spread == pytest.approx(0.05, rel=0.25)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_a_batch_hears_what_its_robots_do(mode):
    options = {"sensor": "sonar", "movers": "bounce:4", "horizon": 8}
    batch = Map2DVectorEnv(3, map="office", autoreset_mode=mode, **options)
    make = [lambda: Map2DEnv("office", **options)] * 3
    alone = gym.vector.SyncVectorEnv(make, autoreset_mode=batch.autoreset_mode)
    actions = np.float32([[0.5, 0.4], [0.9, 1.0], [-0.2, 0.2]])
    pair = [env.reset(seed=5)[0] for env in (batch, alone)]
    for _ in range(20):
        assert np.array_equal(pair[0]["ranges"], pair[1]["ranges"])
        pair = [env.step(actions)[0] for env in (batch, alone)]


def test_check_env_and_bad_input():
    check_env(Map2DEnv("office", sensor="sonar"), skip_render_check=True)
    with pytest.raises(tdac_envs.TaskError, match="sensor"):
        Map2DEnv("office", sensor="sonr")
