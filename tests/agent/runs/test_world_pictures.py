"""Pictures of failures on worlds of a set."""

import io
import math

import numpy as np
import pytest
from few_worlds import write_set
from PIL import Image
from script import AHEAD

from tdac_agent.episodes.trajectory import Trajectory
from tdac_agent.runs.world_pictures import event_on, world_pictures
from tdac_agent.verification.verify_episodes import verify_episodes
from tdac_envs import load_set
from tdac_envs.drawing.canvas import GREEN, MOVER, TRAIL

MOVERS = [{"kind": "bounce", "count": [3, 3], "radius": [4, 5], "speed": [20, 25]}]


@pytest.fixture
def driven(tmp_path, warm):
    """A set with movers that observes the frame of the start, and a report on it."""
    path = write_set(tmp_path / "set.yaml", movers=MOVERS, map=False, frame="start")
    tasks, out = load_set(path), tmp_path / "dev"
    report = verify_episodes(AHEAD.encode(), tasks, 3, split="dev", out=out, judge=warm)
    return tasks, report, out / "trajectories"


def test_what_is_shown_is_what_was_diagnosed(driven):
    """The first sentence of the diagnosis, and the axes in which it gives places."""
    tasks, report, folder = driven
    failed = next(each for each in report.episodes if not each.success)
    task = tasks.task("dev", failed.index)
    trajectory = Trajectory.load(folder / f"{failed.index}.npz")
    event = event_on(tasks.file, task, "world", failed, trajectory)
    assert event.title == f"world: {failed.cause}"
    assert event.facts[0] in failed.text.replace("°", " deg")
    heading = task.start.heading
    assert event.axes == pytest.approx((heading, heading + math.pi / 2))


def test_failures_that_drove_are_drawn_and_fit(driven):
    """No side is shorter than three quarters of the other; movers are seen."""
    tasks, report, folder = driven
    named = [(f"world {each.index}", each) for each in report.episodes]
    drawn = list(world_pictures(tasks, named, folder, 640))
    failed = [name for name, each in named if not each.success]
    assert [name for name, _ in drawn] == failed
    assert failed
    assert list(world_pictures(tasks, named, folder, 640)) == drawn
    (folder / f"{failed[0].split()[1]}.npz").unlink()
    assert list(world_pictures(tasks, named, folder, 640)) == drawn[1:]
    with Image.open(io.BytesIO(drawn[0][1])) as picture:
        assert picture.format == "PNG"
        assert max(picture.size) <= 640
        assert min(picture.size) >= 0.74 * max(picture.size)
        pixels = np.asarray(picture.convert("RGB")).astype(int)
    for colour in (TRAIL, GREEN, MOVER):
        assert (np.abs(pixels - colour).max(axis=-1) <= 8).any(), colour
