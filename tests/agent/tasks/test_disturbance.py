"""Promises of a `Disturbance`: it reaches the environment or is refused in a line."""

import numpy as np
import pytest

from tdac_agent import load_controller, load_task
from tdac_agent.prompting.manual import interface_of
from tdac_agent.tasks.disturbance import Disturbance
from tdac_envs.core.errors import TaskError

ROLLING = """
def policy(obs):
    left, right = float(obs["odometry"][0]), float(obs["odometry"][1])
    return 0.5 + 0.01 * left, 0.4 + 0.01 * right
"""
HIDDEN = Disturbance(wheel_gains=0.1, axle_error=0.05)


@pytest.mark.parametrize("name", ["maze", "epuck"])
def test_hidden_errors_reach_the_environment(name):
    """As its arguments of the same names."""
    env = load_task(name).disturbed_env(HIDDEN)
    assert env.disturbances.wheel_gains == 0.1
    assert env.disturbances.axle_error == 0.05
    assert not env.disturbances.odometry


def test_dropouts_reach_maps():
    """And with them the noise of the ranges."""
    env = load_task("maze").disturbed_env(Disturbance(range_dropout=0.1))
    assert (env.range_dropout, env.range_noise) == (0.1, 0.025)


def test_an_e_puck_has_no_dropouts():
    """Its sensors have no largest range; one line says so."""
    with pytest.raises(TaskError, match="TDAC-EPuck-v0 have no dropouts; leave out --"):
        load_task("epuck").disturbed_env(Disturbance(range_dropout=0.1))


@pytest.mark.parametrize(
    "words",
    [
        ["verify", "c.py", "--task", "epuck", "--robust", "9"],
        ["play", "c.py", "--task", "epuck", "--seed", "1", "--video", "a.gif"],
        ["train", "--task", "epuck"],
    ],
    ids=lambda words: words[0],
)
def test_commands_refuse_dropouts_of_an_e_puck(words, refused, tmp_path, monkeypatch):
    """With exit code 2, before anything is run."""
    if words[0] == "train":
        pytest.importorskip("stable_baselines3")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "c.py").write_text("def policy(obs):\n    return 0.0, 0.0\n")
    error = refused(*words, "--range-dropout", "0.1")
    assert "no dropouts; leave out --range-dropout" in error


def test_the_usual_disturbance_is_what_it_was():
    """Arguments and words of the defaults do not name the further ones."""
    usual = Disturbance()
    assert usual.env_options() == {
        "variation": "jitter",
        "range_noise": 0.025,
        "wheel_slip": 0.03,
        "motor_lag": 0.0,
        "delay": 1,
    }
    assert str(usual) == (
        "jittered starts, range noise 2.5 %, wheel slip 3 %, delay 1 step"
    )
    assert "wheel gains ±10 %, axle error ±5 %" in str(HIDDEN)


@pytest.mark.parametrize(
    ("field", "value"),
    [("wheel_gains", 1.0), ("axle_error", -0.1), ("range_dropout", 1.5)],
)
def test_sizes_that_make_no_sense_are_refused(field, value):
    """By their name."""
    with pytest.raises(TaskError, match=field.replace("_", " ")):
        Disturbance(**{field: value})


def test_a_controller_in_the_sandbox_reads_the_odometry(small_task, tmp_path):
    """A further key of an observation is passed on as the others are."""
    file = tmp_path / "controller.py"
    file.write_text(ROLLING)
    env = small_task.make_env(odometry=True)
    observation, _ = env.reset(seed=0)
    with load_controller(file, small_task) as policy:
        for _ in range(5):
            seen = observation["odometry"].astype(float)
            action = np.asarray(policy(observation), float)
            np.testing.assert_allclose(action, [0.5, 0.4] + 0.01 * seen, rtol=1e-6)
            observation, *_ = env.step(action)
    assert observation["odometry"][0] > 0.0


@pytest.mark.parametrize("name", ["maze", "epuck"])
def test_a_prompt_has_a_row_for_what_is_observed(name):
    """Odometry and encoders appear only if the environment has them."""
    task = load_task(name)
    more = {"odometry": True} | ({"encoders": True} if name == "epuck" else {})
    usual, text = (
        interface_of(task.make_env(**options)).observation for options in ({}, more)
    )
    for key in more:
        assert f"| `{key}` | (2,) |" in text
        assert key not in usual
