"""Promises of pictures in three dimensions: the goal, the path and things are there."""

import os
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest

import tdac_envs  # noqa: F401 - registers the envs
from tdac_envs.core.errors import TaskError, TdacError
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.physics import view
from tdac_envs.physics.view import HEIGHT, WIDTH, gl_context

pytest.importorskip("mujoco")
EMPTY = np.zeros((60, 90), bool)


@pytest.fixture(scope="module", autouse=True)
def can_render():
    try:
        gl_context()
    except TaskError as error:
        pytest.skip(str(error))


def drawn(name, steps=12, **options):
    """The frame after some steps straight ahead."""
    env = gym.make(name, render_mode="rgb_array", view="3d", **options)
    env.reset(seed=0)
    for _ in range(steps):
        env.step(np.array([0.3, 0.3], np.float32))
    return env.render().astype(int)


def share(frame, channel, others):
    """Part of the pixels in which one channel is larger by 40 than others."""
    return float(
        np.all(
            [frame[..., channel] > frame[..., k] + 40 for k in others], axis=0
        ).mean()
    )


def on_empty_map(**options):
    ends = {"start": (20.0, 30.0, 0.0), "goal": (45.0, 30.0), "robot_radius": 3.0}
    return drawn("TDAC-Map2D-v0", map=EMPTY, **ends, **options)


def test_a_frame_is_a_picture_without_a_display():
    frame = drawn("TDAC-EPuck-v0", world="crates")
    assert frame.shape == (HEIGHT, WIDTH, 3)
    assert frame.std() > 20


def test_goal_and_path_are_seen():
    """Green ahead of the robot, in the upper half; a blue path behind it."""
    frame = on_empty_map()
    assert share(frame[: HEIGHT // 2], 1, (0, 2)) > 0.001
    assert share(frame[HEIGHT // 2 :], 2, (0, 1)) > 0.001
    before = on_empty_map(steps=0)
    assert share(before[HEIGHT // 2 :], 2, (0, 1)) < 0.0005


def test_movers_are_seen():
    """A red disc that stands ahead."""
    mover = {"kind": "route", "points": [[32, 24], [32, 25]], "radius": 2.0, "speed": 0}
    red = [share(on_empty_map(movers=m), 0, (1, 2)) for m in (None, [mover])]
    # The robot has an orange lamp.
    assert red[1] > red[0] + 0.003


def test_left_in_the_picture_is_left_of_the_robot():
    """A wall to its left hides the chequered ground in the left half."""
    cells = EMPTY.copy()
    cells[5:24, 20:60] = True
    ends = {"start": (20.0, 30.0, 0.0), "goal": (80.0, 31.0), "robot_radius": 3.0}
    frame = drawn("TDAC-Map2D-v0", map=cells, **ends)
    band = frame[HEIGHT // 2 : 3 * HEIGHT // 4]
    # The ground is warm: it has more red than blue; the wall is grey.
    warm = band[..., 0] > band[..., 2] + 10
    left, right = warm[:, : WIDTH // 4], warm[:, 3 * WIDTH // 4 :]
    assert left.mean() < 0.3
    assert right.mean() > 0.9


def test_a_thing_is_drawn_where_it_is():
    """The picture changes when a crate is pushed, also far from the robot."""
    env = EPuckEnv("crates", render_mode="rgb_array", view="3d", physics="mujoco")
    env.reset(seed=0)
    before = env.render().astype(int)
    env._movables.things[4, :2] += 0.1
    after = env.render().astype(int)
    assert (np.abs(after - before).max(axis=2) > 30).mean() > 0.002


def test_views_of_two_worlds_do_not_disturb_each_other():
    """Each keeps its own objects, also after another one is gone."""
    one = EPuckEnv("crates", render_mode="rgb_array", view="3d")
    one.reset(seed=0)
    first = one.render()
    other = EPuckEnv("arena", render_mode="rgb_array", view="3d")
    other.reset(seed=0)
    other.render()
    del other
    np.testing.assert_array_equal(one.render(), first)


@pytest.mark.parametrize("name", ["TDAC-Map2D-v0", "TDAC-EPuck-v0"])
def test_an_unknown_view_is_refused_in_one_line(name):
    with pytest.raises(TdacError, match=r"view .*'2d'.*'3d'.*'4d'"):
        gym.make(name, view="4d")


def test_without_opengl_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setattr(view.importlib, "import_module", lambda name: 1 / 0)
    view.gl_context.cache_clear()
    try:
        with pytest.raises(TaskError, match=r"install libegl1 .* libosmesa6") as told:
            gl_context()
        assert "\n" not in str(told.value)
    finally:
        monkeypatch.undo()
        view.gl_context.cache_clear()
        gl_context()


def test_a_closed_display_is_opened_again():
    """As after another library has closed the one that EGL gives to all."""
    egl = pytest.importorskip("mujoco.egl")
    first = drawn("TDAC-Map2D-v0", map=EMPTY, start=(20, 30), goal=(70, 30))
    if egl.EGL_DISPLAY is None:
        pytest.skip("OSMesa renders here")
    egl.EGL.eglTerminate(egl.EGL_DISPLAY)
    again = drawn("TDAC-Map2D-v0", map=EMPTY, start=(20, 30), goal=(70, 30))
    assert np.array_equal(first, again)


def test_the_environment_of_other_processes_stays():
    """MuJoCo sets a variable for PyOpenGL, which is gone again."""
    code = "import os; from tdac_envs.physics.view import gl_context; gl_context(); "
    code += "assert 'PYOPENGL_PLATFORM' not in os.environ"
    environment = {k: v for k, v in os.environ.items() if k != "PYOPENGL_PLATFORM"}
    subprocess.run([sys.executable, "-c", code], check=True, env=environment)
