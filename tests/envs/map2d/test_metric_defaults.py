"""Defaults in metres where a map has a resolution, and the paper's elsewhere."""

import re

import cv2
import numpy as np
import pytest

from tdac_envs.core.errors import TaskError
from tdac_envs.drive.task import with_tolerance_note
from tdac_envs.grid.map_units import PIXELS, MapUnits
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.map2d.source import prepare, units_of
from tdac_envs.map2d.task import Pose, Terrain, make_task
from tdac_envs.mapping.bundled import bundled_map, bundled_maps
from tdac_envs.mapping.params import RobotParams
from tdac_envs.mapping.preprocessing import preprocess

ENDS = {"start": (30, 30), "goal": (130, 30)}
SCALE = 0.05
METRIC = {"max_wheel_speed": 0.5 / SCALE, "range_max": 3.5 / SCALE}
PAPER = {"max_wheel_speed": 75.59, "range_max": 220.0}


def small_cells():
    """A room of 160 x 120 px with a block in it, True = occupied."""
    cells = np.zeros((120, 160), np.bool_)
    cells[:3] = cells[-3:] = cells[:, :3] = cells[:, -3:] = True
    cells[50:70, 60:100] = True
    return cells


@pytest.fixture
def plan(tmp_path):
    """The small map as a picture, and the same with a `map.yaml` beside it."""
    cv2.imwrite(str(tmp_path / "p.png"), np.where(small_cells(), 0, 254).astype("u1"))
    (tmp_path / "p.yaml").write_text(
        f"image: p.png\nresolution: {SCALE}\norigin: [0,0,0]"
    )
    return tmp_path / "p.png"


def sizes(robot):
    """What has a default in metres."""
    return {name: getattr(robot, name) for name in METRIC}


@pytest.mark.parametrize("name", ["p.yaml", "p.png"])
def test_a_map_with_a_resolution_has_metric_defaults(plan, name):
    """Of a ROS map, and of a picture whose resolution the user gives."""
    scale = SCALE if name == "p.png" else None
    found = prepare(plan.parent / name, robot_radius=4, resolution=scale, **ENDS)
    assert sizes(found.params.robot) == pytest.approx(METRIC)
    start = Pose(*found.params.start, 0.0)
    task = make_task(Terrain.of(found.grid), start, (130, 30), found.params.robot)
    assert task.goal_tolerance == 4.0
    near = make_task(Terrain.of(found.grid), start, (40, 30), found.params.robot)
    assert near.goal_tolerance == pytest.approx(0.25 * near.shortest)


def test_the_env_has_the_same_defaults_in_both_frames(plan):
    """In metres: 0.5 m/s, 3.5 m, and a tolerance of a body radius."""
    pixels = Map2DEnv(plan.with_suffix(".yaml"), robot_radius=4, **ENDS)
    units = units_of(plan.with_suffix(".yaml"), "metres")
    ends = {name: units.coordinates(*place) for name, place in ENDS.items()}
    metres = Map2DEnv(
        plan.with_suffix(".yaml"), robot_radius=0.2, frame="metres", **ends
    )
    for env in (pixels, metres):
        assert sizes(env.task.robot) == pytest.approx(METRIC)
        assert env.task.goal_tolerance == pytest.approx(4.0)
    assert metres.observation_space["ranges"].high.max() == pytest.approx(3.5)


@pytest.mark.parametrize(
    ("frame", "size"),
    [
        ("pixels", r"in px \(--radius 4, robot_radius=4: 0.2 m\)"),
        ("metres", r"in metres \(--radius 0.2, robot_radius=0.2\)"),
    ],
)
def test_a_task_on_a_map_with_a_resolution_needs_a_radius(plan, frame, size):
    """The paper's 15 px are a robot of 0.75 m at 5 cm per pixel."""
    ends = {"start": (1.0, 1.0), "goal": (6.0, 1.0)} if frame == "metres" else ENDS
    wanted = rf"p.yaml: .*give the body's radius {size} or a robot \(--robot NAME\)"
    with pytest.raises(TaskError, match=wanted):
        Map2DEnv(plan.with_suffix(".yaml"), frame=frame, **ends)


def test_a_robot_counts_as_given(plan):
    """It has a radius, and all else of it is its own."""
    robot = RobotParams(radius=5.0, axle_length=8.0, max_wheel_speed=7.0, n_rays=4)
    found = prepare(plan.with_suffix(".yaml"), robot=robot, **ENDS)
    assert found.params.robot == robot
    larger = prepare(plan.with_suffix(".yaml"), robot=robot, robot_radius=6.0, **ENDS)
    assert larger.params.robot == robot.changed(radius=6.0, axle_length=12.0)


def test_a_map_alone_needs_no_radius(plan):
    """To read off start and goal; it is read for a robot of 0.2 m."""
    assert preprocess(plan.with_suffix(".yaml"))[1].robot.radius == pytest.approx(4.0)
    assert preprocess(plan)[1].robot == RobotParams()


def test_a_map_without_a_resolution_keeps_the_defaults_of_the_paper(plan, tmp_path):
    """A picture, an array and a .npy file: 15 px, 75.59 px/s, 220 px, 20 px."""
    np.save(tmp_path / "p.npy", small_cells())
    for source in (plan, small_cells(), tmp_path / "p.npy"):
        env = Map2DEnv(source, **ENDS)
        assert env.task.robot == RobotParams()
        assert env.task.goal_tolerance == 20.0


@pytest.mark.parametrize("name", bundled_maps())
def test_bundled_maps_keep_the_defaults_of_the_paper(name):
    """None has a resolution, and no tolerance of theirs is pointed out."""
    found = prepare(name)
    assert sizes(found.params.robot) == PAPER
    assert found.grid.resolution is None
    assert bundled_map(name).robot_radius >= 10.0


@pytest.mark.parametrize(
    ("radius", "tolerance", "units", "said"),
    [
        (4.0, 8.0, PIXELS, None),
        (4.0, 20.0, PIXELS, "the tolerance of 20 px is 5.0 radii: .*--tolerance"),
        (4.0, 20.0, "metres", "the tolerance of 1 m is 5.0 radii"),
    ],
)
def test_a_tolerance_above_two_radii_is_pointed_out(
    plan, radius, tolerance, units, said
):
    """Once, also if the notes are those of the same task."""
    if units == "metres":
        units = units_of(plan.with_suffix(".yaml"), "metres")
    assert isinstance(units, MapUnits)
    robot = RobotParams.disc(radius)
    grid = prepare(plan, robot=robot, **ENDS).grid
    start = Pose(30.0, 30.0, 0.0)
    task = make_task(
        Terrain.of(grid), start, (130, 30), robot, goal_tolerance=tolerance
    )
    notes = with_tolerance_note(("other",), task, units.length)
    notes = with_tolerance_note(notes, task, units.length)
    assert len(notes) == (1 if said is None else 2)
    assert said is None or re.match(said, notes[1])


def test_the_note_is_among_those_of_the_preparation(plan):
    """A small robot, and the tolerance of the paper: 20 px."""
    assert "is 5.0 radii" in Map2DEnv(plan, robot_radius=4, **ENDS).params.notes[-1]
    assert Map2DEnv(plan, robot_radius=10, **ENDS).params.notes == ()
