"""Promises of where a map comes from."""

import json
import os

import cv2
import numpy as np
import pytest

from tdac_envs.core.errors import MapError, TaskError
from tdac_envs.map2d.source import prepare, units_of
from tdac_envs.mapping.bundled import bundled_map, bundled_maps
from tdac_envs.mapping.params import MapParams

ENDS = {"start": (10, 20), "goal": (70, 20)}


@pytest.fixture
def cells():
    grid = np.zeros((40, 80), bool)
    grid[10:, 38:42] = grid[:, 0] = True
    return grid


@pytest.fixture
def picture(cells, tmp_path):
    path = tmp_path / "room.png"
    cv2.imwrite(str(path), np.where(cells, 0, 255).astype(np.uint8))
    return path


def ros_map(folder, cells, resolution=0.05):
    cv2.imwrite(str(folder / "ros.png"), np.where(cells, 0, 255).astype(np.uint8))
    text = (
        f"image: ros.png\nresolution: {resolution}\norigin: [-1.0, 2.0, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
    )
    (folder / "ros.yaml").write_text(text)
    return folder / "ros.yaml"


@pytest.mark.parametrize("name", bundled_maps())
def test_a_bundled_map_brings_its_task(name):
    bundled, prepared = bundled_map(name), prepare(name)
    assert prepared.params.start == bundled.start
    assert prepared.params.goal == bundled.goal
    assert prepared.params.robot.radius == bundled.robot_radius
    assert prepared.image == bundled.image


def test_what_is_given_wins_over_the_bundled_task():
    bundled = bundled_map("maze")
    prepared = prepare("maze", heading=1.5, robot_radius=10.0)
    assert prepared.params.heading == 1.5
    assert prepared.params.robot.radius == 10.0
    assert prepared.params.robot.axle_length == 20.0
    assert prepared.params.start == bundled.start


def test_the_default_map_does_not_depend_on_the_folder(tmp_path, monkeypatch):
    (tmp_path / "maze").mkdir()
    monkeypatch.chdir(tmp_path)
    assert prepare("maze").params.source == "maze.png"


def test_arrays_and_nested_lists_are_the_grid_itself(cells):
    for source in (cells, cells.tolist(), cells.astype(int).tolist()):
        prepared = prepare(source, robot_radius=3, **ENDS)
        np.testing.assert_array_equal(prepared.grid.cells, cells)
        assert prepared.params.polarity == "given"


def test_the_array_is_copied(cells):
    prepared = prepare(cells, **ENDS)
    cells[:] = True
    assert not prepared.grid.cells.all()


def test_start_may_bring_the_heading_and_be_any_sequence(cells):
    start, goal = np.array([10.0, 20.0, 0.7]), [70, 20]
    params = prepare(cells, start, goal).params
    assert (params.start, params.heading, params.goal) == ((10, 20), 0.7, (70, 20))
    assert prepare(cells, start, goal, heading=-1.0).params.heading == -1.0


@pytest.mark.parametrize("kind", ["picture", "npy", "folder", "ros"])
def test_every_kind_of_file_gives_the_same_grid(kind, cells, picture, tmp_path):
    if kind == "picture":
        source = picture
    elif kind == "npy":
        source = tmp_path / "grid.npy"
        np.save(source, cells)
    elif kind == "ros":
        source = ros_map(tmp_path, cells)
    else:
        source = tmp_path / "folder"
        source.mkdir()
        np.save(source / "occupancy.npy", cells)
        prepare(cells, robot_radius=3, **ENDS).params.save(source / "params.json")
    prepared = prepare(str(source), robot_radius=3, **ENDS)
    np.testing.assert_array_equal(prepared.grid.cells, cells)
    assert prepared.params.start == (10, 20)


def test_a_folder_keeps_its_robot_but_for_the_radius_that_is_given(cells, tmp_path):
    np.save(tmp_path / "occupancy.npy", cells)
    params = prepare(cells, robot_radius=3, **ENDS).params
    robot = params.robot.model_copy(update={"n_rays": 5, "axle_length": 4.5})
    params.model_copy(update={"robot": robot}).save(tmp_path / "params.json")
    assert prepare(tmp_path).params.robot == robot
    other = prepare(tmp_path, robot_radius=2.0).params.robot
    assert (other.n_rays, other.radius, other.axle_length) == (5, 2.0, 4.0)


class TestSnap:
    def test_an_array(self, cells):
        params = prepare(cells, (2, 20), (40, 30), robot_radius=5, snap=True).params
        assert params.start == (6, 20)
        assert params.goal is not None
        # The other side of the wall is nearer, but the start is not there.
        assert params.goal == (32, 30)
        assert len(params.notes) == 2

    def test_a_picture(self, picture):
        params = prepare(picture, (2, 20), (70, 20), robot_radius=4, snap=True).params
        assert params.start == (5, 20)
        assert params.goal == (70, 20)

    def test_what_is_free_stays(self, cells):
        given = {"start": (10.25, 20.5), "goal": (70, 20)}
        params = prepare(cells, **given, robot_radius=5, snap=True).params
        assert (params.start, params.goal) == ((10.25, 20.5), (70, 20))
        assert not params.notes


class TestCache:
    def test_the_same_grid_is_shared(self):
        assert prepare("maze").grid is prepare("maze", heading=1.0).grid

    def test_a_file_that_changed_is_read_again(self, picture, cells):
        before = prepare(picture, robot_radius=3, **ENDS).grid
        times = os.stat(picture)
        cells[0:2] = True
        cv2.imwrite(str(picture), np.where(cells, 0, 255).astype(np.uint8))
        os.utime(picture, ns=(times.st_atime_ns, times.st_mtime_ns))
        after = prepare(picture, robot_radius=3, **ENDS).grid
        assert before != after

    def test_a_ros_picture_that_changed_is_read_again(self, cells, tmp_path):
        source = ros_map(tmp_path, cells)
        before = prepare(source, robot_radius=3, **ENDS).grid
        cells[0:2] = True
        ros_map(tmp_path, cells)
        assert prepare(source, robot_radius=3, **ENDS).grid != before


class TestMetres:
    def test_of_a_ros_map(self, cells, tmp_path):
        """The corner of the lower-left pixel lies at the origin, (-1, 2) m."""
        source = ros_map(tmp_path, cells)
        units = units_of(source, "metres")
        assert units.pixels((-1.0, 2.0)) == pytest.approx((-0.5, 39.5))
        assert units.length_in_pixels(0.3) == pytest.approx(6.0)

    def test_of_a_folder(self, cells, tmp_path):
        prepared = prepare(ros_map(tmp_path, cells), robot_radius=3, **ENDS)
        np.save(tmp_path / "occupancy.npy", cells)
        prepared.params.save(tmp_path / "params.json")
        goal = units_of(tmp_path, "metres").pixels((0.0, 3.0))
        assert goal == pytest.approx((19.5, 19.5))

    def test_a_picture_has_no_metres(self, picture):
        with pytest.raises(MapError, match="no resolution"):
            units_of(picture, "metres")


class TestRefused:
    @pytest.mark.parametrize(
        ("source", "message"),
        [
            ("mase", r"no map 'mase': no such file \(did you mean 'maze'\?\)"),
            ("nowhere/map.png", "no map 'nowhere/map.png': no such file"),
            (np.zeros((4, 4)), "expected a bool array .* got float64"),
            ([[0, 1], [0]], "rows of the map to have the same length"),
            ([[0, 2], [0, 1]], "expected a bool array"),
            (None, "expected a bool array"),
            (np.zeros(4, bool), "expected a 2-D grid"),
        ],
    )
    def test_a_map_that_is_none(self, source, message):
        with pytest.raises(MapError, match=message):
            prepare(source, **ENDS)

    @pytest.mark.parametrize(
        ("given", "message"),
        [
            ({}, "no start and no goal for array: give start and goal in pixels"),
            ({"start": (1, 2)}, "no goal for array"),
            ({**ENDS, "start": (np.nan, 2)}, "expected start to be 2 finite numbers"),
            ({**ENDS, "start": 5}, "expected start to be 2 finite numbers"),
            ({**ENDS, "goal": (1, np.inf)}, "expected goal to be 2 finite numbers"),
            ({**ENDS, "heading": np.nan}, "expected heading to be a finite number"),
            ({**ENDS, "robot_radius": 0}, "expected robot_radius above 0, got 0"),
            ({**ENDS, "robot_radius": np.nan}, "expected robot_radius to be"),
        ],
    )
    def test_a_task_that_is_none(self, cells, given, message):
        with pytest.raises(TaskError, match=message):
            prepare(cells, **given)

    def test_a_folder_without_its_files(self, tmp_path):
        with pytest.raises(MapError, match=r"params\.json"):
            prepare(tmp_path)

    def test_a_grid_file_that_is_none(self, tmp_path):
        (tmp_path / "grid.npy").write_bytes(b"nothing")
        with pytest.raises(MapError, match="cannot read the grid"):
            prepare(tmp_path / "grid.npy", **ENDS)
        np.save(tmp_path / "grid.npy", np.zeros((3, 3)))
        with pytest.raises(MapError, match="expected a bool array"):
            prepare(tmp_path / "grid.npy", **ENDS)

    def test_params_with_an_unknown_field(self, cells, tmp_path):
        params = json.loads(prepare(cells, **ENDS).params.model_dump_json())
        (tmp_path / "params.json").write_text(json.dumps({**params, "speed": 1}))
        with pytest.raises(MapError, match="speed"):
            MapParams.load(tmp_path / "params.json")
