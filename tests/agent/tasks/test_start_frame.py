"""The frame of a start pose is that of the observations of a level without a map."""

import math

import numpy as np
import pytest

from tdac_agent.environments.epuck.surroundings import WorldSurroundings
from tdac_agent.environments.map2d.surroundings import MapSurroundings
from tdac_agent.tasks.start_frame import StartFrame
from tdac_agent.tasks.units import METRES, PIXELS
from tdac_agent.verification.diagnosis.gap import gap_figure
from tdac_envs import load_set
from tdac_envs.drive.task import Pose
from tdac_envs.ladder.observed import SetView


@pytest.mark.parametrize("index", range(3))
@pytest.mark.parametrize("level", ["unknown", "floor"])
def test_places_and_headings_are_as_observed(level, index):
    """In px, and in metres with y to the left."""
    tasks = load_set(level)
    task, view = (
        tasks.task("dev", index),
        SetView(tasks.file, tasks.largest_side, False),
    )
    poses = np.array([[31.0, 47.0, 2.0], [80.5, 12.25, -3.0]])
    anchors = np.array([view.anchor(task)] * len(poses))
    none = {key: np.zeros((2, 1), np.float32) for key in tasks.file.observed}
    seen = view.seen(none, poses, anchors)
    frame = StartFrame(task.start).in_metres(tasks.file.resolution)
    for (x, y, heading), own in zip(poses.tolist(), seen["pose"], strict=True):
        assert frame.coordinates(x, y) == pytest.approx(own[:2].tolist(), abs=1e-4)
        turned = math.remainder(frame.heading(heading) - float(own[2]), math.tau)
        assert turned == pytest.approx(0.0, abs=1e-5)
        assert frame.pixels(frame.coordinates(x, y)) == pytest.approx((x, y))
    goal = seen["goal"][0].tolist()
    assert frame.coordinates(*task.goal) == pytest.approx(goal, abs=1e-4)


def test_places_in_worlds_are_as_observed():
    """In metres, with y to the left of the start."""
    tasks = load_set("epuck")
    task, view = tasks.task("dev", 1), SetView(tasks.file, tasks.largest_side, False)
    frame = StartFrame.of(task.start, METRES)
    goal = METRES.on_screen([task.goal])[0].tolist()
    seen = view.anchor(task)[5:].tolist()
    assert frame.coordinates(*goal) == pytest.approx(seen, abs=1e-9)
    assert frame.pixels(frame.coordinates(*goal)) == pytest.approx(goal)
    around = WorldSurroundings(task).shown_in(METRES.from_start(frame))
    mistaken = around.mistaken_goals()["y counted to the right"]
    assert frame.coordinates(*mistaken) == pytest.approx((seen[0], -seen[1]))
    units = METRES.from_start(StartFrame.of(Pose(1.0, 2.0, math.pi / 2), METRES))
    assert units.point(500.0, -2250.0) == "(0.250, 0.500)"
    assert units.pose(1000.0, -2000.0, 0.0) == "0.000 0.000 -90"
    assert units.far(12.34) == "0.012 m"


def test_texts_use_it():
    """A place 10 px ahead and 5 px to the right of a robot that faces down."""
    units = PIXELS.from_start(StartFrame(Pose(100.0, 50.0, math.pi / 2)))
    assert units.point(95.0, 60.0) == "(10.0, 5.0)"
    assert units.place_text(95.0, 60.0) == "(10, 5)"
    assert units.pose(100.0, 50.0, math.pi / 2) == "0.0 0.0 0"
    assert units.far(12.34) == "12.3 px"
    assert units.figure(12.34) == "12.3 px"


def test_mixed_up_goals_are_those_of_the_frame():
    """A goal with x and y swapped is so in the coordinates that were observed."""
    task = load_set("unknown").task("dev", 0)
    frame = StartFrame(task.start)
    around = MapSurroundings(task).shown_in(PIXELS.from_start(frame))
    x, y = frame.coordinates(*task.goal)
    mistakes = around.mistaken_goals()
    assert frame.coordinates(*mistakes["x and y swapped"]) == pytest.approx((y, x))
    left = frame.coordinates(*mistakes["y counted to the left"])
    assert left == pytest.approx((x, -y))


def test_lengths_in_the_frame_of_a_start():
    """A length of an environment in metres stays one: 6 mm are not 6 micrometres."""
    units = METRES.from_start(StartFrame.of(Pose(1.0, 2.0, 0.0), METRES))
    assert units.figure(0.0061) == "0.0061 m"
    assert gap_figure(0.0061, units) == "6.1 mm"
