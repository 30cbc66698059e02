"""The picture of a failure for a model: what it shows, and what it never shows."""

import io
import itertools

import numpy as np
import pytest
from PIL import Image
from script import AHEAD
from skimage.color import rgb2lab

from tdac_agent import load_task
from tdac_agent.verification.diagnosis.model_picture import failure_picture
from tdac_agent.verification.verify import load_trajectories, verify
from tdac_envs.drawing.canvas import FREE, GREEN, MOVER, TRAIL, WALL
from tdac_envs.drawing.closeup import EVENT

# Machado, Oliveira and Fernandes 2009, severity 1, for linear RGB.
VISION = {
    "normal": np.eye(3),
    "without red": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "without green": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "without blue": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}


@pytest.fixture(scope="module")
def failed(small_task, tmp_path_factory, warm):
    """A task, the report on a failure, and the trajectories."""
    out = tmp_path_factory.mktemp("failed")
    task = small_task.with_profile("policy")
    report = verify(AHEAD, task, out=out, judge=warm)
    return task, report, load_trajectories(out / "trajectories")


def held_out(report, *names):
    """A report whose starts of these names are held out, and no others."""
    episodes = [
        each.model_copy(update={"held_out": each.name in names})
        for each in report.episodes
    ]
    return report.model_copy(update={"episodes": tuple(episodes)})


def test_the_nominal_start_comes_first(failed):
    task, report, trajectories = failed
    shown = failure_picture(task, report, trajectories, 1024)
    assert shown.caption == "nominal: collision"
    assert shown.event.contact is not None
    assert not shown.y_up


def test_a_held_out_start_is_never_drawn(failed):
    """Whichever starts are held out; if only they failed, there is no picture."""
    task, report, trajectories = failed
    # One trajectory under all names: every episode could be drawn.
    driven = trajectories["nominal"]
    names = ("nominal", "jitter 1", "jitter 2")
    first = next(each for each in report.episodes if each.name == "nominal")
    episodes = tuple(first.model_copy(update={"name": name}) for name in names)
    report = report.model_copy(update={"episodes": episodes})
    known = dict.fromkeys(names, driven)
    for count in range(len(names) + 1):
        for hidden in itertools.combinations(names, count):
            shown = failure_picture(task, held_out(report, *hidden), known, 1024)
            public = [name for name in names if name not in hidden]
            assert (shown is None) == (not public)
            if shown is not None:
                assert shown.caption.partition(":")[0] == public[0]


def test_an_episode_that_did_not_drive_is_not_drawn(failed):
    task, report, _ = failed
    assert failure_picture(task, report, {}, 1024) is None


@pytest.mark.slow_after(1)
@pytest.mark.parametrize("name", ["maze", "street", "epuck-maze"])
def test_a_picture_fits_and_is_the_same_each_time(name, tmp_path, warm):
    """Its shorter side has three quarters of the longer one at least."""
    task = load_task(name).with_profile("policy")
    report = verify(AHEAD, task, out=tmp_path, judge=warm)
    known = load_trajectories(tmp_path / "trajectories")
    one, other = (failure_picture(task, report, known, 1024) for _ in range(2))
    assert one.png == other.png
    assert one.y_up == name.startswith("epuck")
    with Image.open(io.BytesIO(one.png)) as picture:
        assert picture.info == {}
        assert max(picture.size) <= 1024
        assert min(picture.size) >= 0.74 * max(picture.size)
        pixels = np.asarray(picture.convert("RGB")).astype(int)
    for colour in (TRAIL, GREEN, EVENT):
        assert (np.abs(pixels - colour).max(axis=-1) <= 8).any(), colour


def linear(colour):
    value = np.array(colour) / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def seen_as(colour, matrix):
    """The colour as CIELAB of what somebody sees."""
    value = np.clip(np.array(matrix) @ linear(colour), 0.0, 1.0)
    shown = np.where(
        value <= 0.0031308, 12.92 * value, 1.055 * value ** (1 / 2.4) - 0.055
    )
    return rgb2lab(shown[None, None])[0, 0]


@pytest.mark.parametrize("kind", VISION)
def test_the_colours_are_told_apart_by_everybody(kind):
    """Free space, walls, the way, the goal, the contact and movers, pair by pair."""
    colours = (FREE, WALL, TRAIL, GREEN, EVENT, MOVER)
    labs = [seen_as(colour, VISION[kind]) for colour in colours]
    for one, other in itertools.combinations(labs, 2):
        assert np.linalg.norm(one - other) > 12.0
