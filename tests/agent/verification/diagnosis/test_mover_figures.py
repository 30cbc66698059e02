"""Pictures of episodes with movers: discs at the end, and trails of a second."""

import math

import numpy as np
import pytest
from driving import drive
from small import write_small_task

from tdac_agent import load_task
from tdac_agent.verification.diagnosis.figures import contact_of
from tdac_envs.drawing.canvas import MOVER
from tdac_envs.drawing.closeup import Event, run_picture
from tdac_envs.drawing.runs import Legend

# It comes from below, and meets the robot on its way to the right.
CROSSING = {"kind": "bounce", "start": [60, 100], "heading": -1.57, "speed": 25}


@pytest.fixture(scope="module")
def task(tmp_path_factory):
    """The small task with a mover in the way."""
    folder = tmp_path_factory.mktemp("crossing")
    return load_task(write_small_task(folder, movers=[CROSSING | {"radius": 8}]))


@pytest.fixture(scope="module")
def rollout(task):
    """An episode that ends at the mover."""
    env = task.make_env(on_collision="terminate")
    return drive(env, lambda obs: (0.2, 0.2) if obs["pose"][0] < 55 else (0.0, 0.0))


def dark(picture):
    """Places (x, y) of the rims of movers."""
    rows, columns = np.nonzero(np.abs(picture - np.array(MOVER, int)).max(-1) <= 8)
    return np.column_stack([columns, rows])


def on_frame(task, places):
    return task.pictures().backdrop().whole().canvas.to_frame(places)


def test_ghosts_are_those_of_a_second(rollout):
    """The last one is that of the step, and the first a second before."""
    trajectory = rollout.trajectory
    ghosts = trajectory.ghosts(trajectory.steps)
    assert len(ghosts) == 1 + round(1.0 / trajectory.dt)
    assert np.array_equal(ghosts[-1], trajectory.movers[-1])
    assert len(trajectory.ghosts(3)) == 4


def test_the_contact_is_at_the_mover(task, rollout):
    """At the edge of both discs, also in the report's player."""
    x, y = contact_of(task.nominal, rollout.trajectory, rollout.outcome)
    assert rollout.contact == "mover_standing"
    robot, mover = rollout.trajectory.poses[-1], rollout.trajectory.movers[-1, 0]
    assert math.dist((x, y), robot[:2]) == pytest.approx(6.0, abs=0.01)
    assert math.dist((x, y), mover[:2]) == pytest.approx(8.0, abs=0.01)


@pytest.mark.parametrize("kind", ["trajectory", "failure", "frame"])
def test_each_picture_has_the_mover(task, rollout, kind):
    """Its rim is where it was at the end; without it there is none."""
    trajectory, pictures = rollout.trajectory, task.pictures()
    poses, ghosts = trajectory.poses, trajectory.ghosts(trajectory.steps)
    for movers in (ghosts, []):
        if kind == "trajectory":
            picture = pictures.trajectories([poses], ["collision"], ["one"], movers)
        elif kind == "failure":
            event = Event("title", (), poses[-1:, :2], movers=movers)
            picture = run_picture(pictures.backdrop(), poses, event)
        else:
            if not movers:
                continue
            *_, picture = pictures.frames(rollout, 10)
        rows = pictures.backdrop().whole().canvas.strip_top
        columns = pictures.backdrop().whole().canvas.image.shape[1]
        rims = dark(picture[:rows, :columns])
        assert (len(rims) > 0) == bool(movers)
        if movers:
            ((x, y),) = on_frame(task, ghosts[-1][:, :2])
            scale = columns / 160
            far = np.hypot(*(rims - (x, y)).T)
            assert np.median(far) == pytest.approx(8 * scale, abs=3)


def test_the_legend_names_the_run_whose_movers_are_drawn():
    """If there are several."""

    def texts(labels, movers=True):
        outcomes = [""] * len(labels)
        legend = Legend.of(outcomes, labels, path=False, width=900, movers=movers)
        return [entry.text for row in legend.rows for _, entry in row]

    assert texts(["one"])[-1] == "movers at the end"
    assert texts(["one", "two"])[-1] == "movers at the end of one"
    assert texts(["one", "two"], movers=False) == ["one", "two"]
