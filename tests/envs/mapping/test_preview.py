"""Pictures of a map: rulers in the user's units, legend, and why a task fails."""

import math

import cv2
import numpy as np
import pytest

from tdac_envs.core.errors import RefusedError
from tdac_envs.drawing.canvas import RED, Canvas
from tdac_envs.grid.grid import OccupancyGrid
from tdac_envs.grid.map_units import PIXELS, MapUnits
from tdac_envs.mapping.fault import fault_of
from tdac_envs.mapping.image import from_array
from tdac_envs.mapping.map_files import read_ros_yaml
from tdac_envs.mapping.map_folder import preview_of, write_pictures
from tdac_envs.mapping.preprocessing import preprocess
from tdac_envs.mapping.rulers import Rulers, tick_step

START, GOAL = (40, 40), (160, 80)


def rooms(gap=None):
    """Two rooms; the wall between them is closed, or has a gap of some px."""
    cells = np.zeros((120, 200), np.bool_)
    cells[:, 98:102] = True
    if gap is not None:
        cells[60 : 60 + gap, 98:102] = False
    return cells


def refusal(cells, start=START, goal=GOAL, radius=8.0, units=PIXELS):
    with pytest.raises(RefusedError) as caught:
        preprocess(cells, start, goal, radius, units=units)
    return caught.value


def fault(error):
    _, grid, params, units = error.pictures["refused"]
    return fault_of(grid.cells, params, units)


def test_a_closed_wall_is_marked_where_it_is_thinnest():
    cells = rooms()
    cells[20:30, 99:102] = False
    found = fault(refusal(cells))
    assert found.label == "closed here"
    assert found.at[0] == pytest.approx(98, abs=1.5)
    assert 20 <= found.at[1] < 30


def test_the_narrowest_gap_is_marked():
    found = fault(refusal(rooms(gap=10)))
    assert found.label == "narrowest gap: a radius of 4.3 px gets through"
    assert math.dist(found.at, (99.5, 64.5)) < 3
    assert found.start_side[START[::-1]]
    assert found.goal_side[GOAL[::-1]]
    assert not (found.start_side & found.goal_side).any()


def test_the_gap_is_named_in_metres():
    units = MapUnits.metres(OccupancyGrid(rooms(), 0.1, (0.0, 0.0, 0.0)))
    error = refusal(rooms(gap=10), units=units)
    assert fault(error).label == "narrowest gap: a radius of 0.43 m gets through"
    assert str(error) == (
        "array: start (4.05, 7.95) and goal (16.05, 3.95) are not connected for a "
        "robot of 0.8 m radius; the largest radius that gets through is 0.43 m"
    )


@pytest.mark.parametrize(
    ("start", "label", "better"),
    [
        ((99, 40), "start in an obstacle", True),
        ((94, 40), "start too near to an obstacle", True),
        ((-50, 40), "start outside the map, in this direction", False),
    ],
)
def test_an_end_where_the_body_does_not_fit_is_marked(start, label, better):
    found = fault(refusal(rooms(gap=30), start))
    assert found.label == label
    assert (found.better is not None) == better
    assert found.at == (max(start[0], 0), 40)


def test_a_feasible_task_has_no_fault():
    grid, params = preprocess(rooms(gap=30), START, GOAL, 8.0)
    assert fault_of(grid.cells, params, PIXELS) is None


def test_a_refused_map_leaves_a_picture(tmp_path):
    """It has a ring at the place where the task fails."""
    error = refusal(rooms(gap=10))
    error.folder = tmp_path / "made"
    (file,) = write_pictures(error)
    assert file == tmp_path / "made" / "refused.png"
    picture = cv2.cvtColor(cv2.imread(str(file)), cv2.COLOR_BGR2RGB)
    ring = (picture[: 30 + 4 * 120] == RED).all(axis=2)
    rows, columns = np.nonzero(ring)
    canvas = Canvas(rooms(), strip=0)
    (centre,) = canvas.to_frame(fault(error).at)
    assert columns.mean() == pytest.approx(centre[0] + 52, abs=2)
    assert rows.mean() == pytest.approx(centre[1] + 30, abs=2)


@pytest.mark.parametrize("scale", [0.1, 0.5, 1.0, 4.0, 9.0])
@pytest.mark.parametrize("resolution", [None, 0.01, 0.05, 1.0])
def test_ticks_are_round_and_apart(scale, resolution):
    units = PIXELS
    if resolution is not None:
        units = MapUnits.metres(OccupancyGrid(rooms(), resolution))
    step = tick_step(scale, units)
    assert step / units.per_pixel * scale + 1e-9 >= 70
    mantissa = step / 10 ** math.floor(math.log10(step) + 1e-9)
    assert min(abs(mantissa - round_) for round_ in (1, 2.5, 5)) < 1e-6


def ticks(units):
    """Rows and columns of the ticks in the margins."""
    cells = rooms()
    canvas, rulers = Canvas(cells, strip=0), Rulers(cells.shape, units)
    framed = np.full((30 + 480, rulers.left + 814, 3), 236, np.uint8)
    rulers.draw(canvas, framed)
    dark = framed.sum(axis=2) < 300
    rows, columns = dark[30:510, rulers.left - 2], dark[28, rulers.left :]
    return np.flatnonzero(rows) + 30, np.flatnonzero(columns)


def test_rulers_in_pixels_mark_pixel_centres():
    rows, columns = ticks(PIXELS)
    np.testing.assert_allclose(columns, 4 * (5 * np.arange(40) + 0.5) - 0.5, atol=0.6)
    np.testing.assert_allclose(rows - 30, 4 * (5 * np.arange(24) + 0.5) - 0.5, atol=0.6)


def test_rulers_in_metres_follow_the_frame():
    """x = 0 is ten pixels from the left border, and y grows upwards."""
    frame = OccupancyGrid(rooms(), 0.1, (-1.0, -2.0, 0.0))
    rows, columns = ticks(MapUnits.metres(frame))
    assert np.abs(columns - (40 - 0.5)).min() <= 0.6
    assert np.abs(rows - 30 - (4 * (120 - 20) - 0.5)).min() <= 0.6
    steps = np.diff(columns)
    assert steps == pytest.approx(steps[0], abs=1)


def test_rulers_of_a_rotated_frame_are_drawn():
    """They are oblique lines over the map; nothing fails at any angle."""
    for yaw in (0.3, math.pi / 2, -2.0, math.pi):
        units = MapUnits.metres(OccupancyGrid(rooms(), 0.1, (3.0, -2.0, yaw)))
        rows, columns = ticks(units)
        assert rows.size + columns.size > 2


def legend_colours(picture):
    return {tuple(colour) for colour in picture[-70:-4, 52:600].reshape(-1, 3)}


def test_unknown_is_apart_from_obstacles(tmp_path):
    """The preview of a ROS map has a third colour, in the map and in its legend."""
    shades = np.full((60, 90), 254, np.uint8)
    shades[:20], shades[:, :5] = 205, 0
    cv2.imwrite(str(tmp_path / "map.png"), shades)
    (tmp_path / "map.yaml").write_text("image: map.png\nresolution: 0.05\n")
    image = read_ros_yaml(tmp_path / "map.yaml")
    assert image.unknown is not None
    np.testing.assert_array_equal(image.unknown, shades == 205)
    np.testing.assert_array_equal(image.occupied, shades != 254)
    for source in (image, from_array(shades)):
        grid, params = preprocess(source)
        assert grid.cells[10, 40]
        shown = preview_of(source, grid, params)
        free, solid, unknown = (
            tuple(shown[30 + 10 * y, 52 + 10 * x])
            for x, y in ((43, 43), (2, 43), (43, 7))
        )
        assert len({free, solid, unknown}) == 3
        assert {free, solid, unknown} <= legend_colours(shown)


@pytest.mark.parametrize("start", [(8, 119.5), (199.5, 8), (-0.6, 8), (1e9, 8)])
def test_a_start_at_or_beyond_the_border_is_drawn(start, tmp_path):
    """Pixels reach half a pixel beyond their centres, and the border is outside."""
    error = refusal(rooms(gap=60), start=start)
    error.folder = tmp_path
    (file,) = write_pictures(error)
    assert cv2.imread(str(file)) is not None
    assert fault(error).label.startswith("start outside the map")


def plan():
    """A closed building with paper around it, as a grey picture; 120 x 200 px."""
    picture = np.full((120, 200), 255, np.uint8)
    cv2.rectangle(picture, (30, 20), (170, 100), 0, 5)
    return picture


INSIDE, BEYOND = (60, 60), (10, 10)


@pytest.mark.parametrize("coloured", [False, True])
def test_the_outside_of_a_plan_is_apart_from_its_walls(coloured):
    """It has a colour of its own, in the preview and in its legend."""
    picture = np.dstack([plan()] * 3)
    if coloured:
        picture[picture[..., 0] == 0] = (230, 30, 30)
        picture[20:25, 60:140] = (235, 225, 20)
    source = from_array(picture)
    grid, params = preprocess(source, INSIDE, (140, 60), 8.0)
    assert grid.cells[BEYOND[::-1]]
    shown = preview_of(source, grid, params)
    free, wall, outside = (
        tuple(shown[30 + 4 * y, 52 + 4 * x])
        for x, y in ((100, 80), (100, 20), (101, 6))
    )
    assert len({free, wall, outside}) == 3
    legend = {
        tuple(colour) for colour in shown[30 + 480 :, 52:].reshape(-1, 3).tolist()
    }
    # The swatch of walls in two colours has their mean colour.
    for colour in (free, outside) if coloured else (free, wall, outside):
        gaps = [np.abs(np.subtract(colour, other)).max() for other in legend]
        assert min(gaps) <= 2


@pytest.mark.parametrize("name", ["start", "goal"])
@pytest.mark.parametrize("place", [BEYOND, (10, 3)])
def test_an_end_outside_of_a_closed_wall_is_named(name, place):
    """Also if it is too near to the border of the map, which is not the reason."""
    ends = {"start": INSIDE, "goal": INSIDE, name: place}
    other = "goal" if name == "start" else "start"
    error = refusal(plan(), ends["start"], ends["goal"])
    text = f": {name} {place} lies outside of the closed wall around {other} {INSIDE}"
    assert str(error).endswith(text)
    found = fault(error)
    assert (found.label, found.at) == (f"{name} outside of the closed wall", place)
    assert found.better is not None
    assert 30 < found.better[0] < 170
    assert 20 < found.better[1] < 100


def test_two_closed_rooms_are_still_called_closed():
    """Neither is the outside of the other."""
    cells = rooms()
    cells[:2] = cells[-2:] = cells[:, :2] = cells[:, -2:] = True
    assert "no robot gets through: a wall blocks the way" in str(refusal(cells))


@pytest.mark.parametrize(
    ("start", "asked"), [((-5, 3), True), ((-50, 3), False), ((400, 300), False)]
)
def test_metres_typed_as_pixels_are_recognised(tmp_path, start, asked):
    """Only if both places would be free in metres, and the map has a resolution."""
    cv2.imwrite(str(tmp_path / "map.png"), np.where(rooms(30), 0, 254).astype(np.uint8))
    (tmp_path / "map.yaml").write_text(
        "image: map.png\nresolution: 0.1\norigin: [-10, -6, 0]\n"
    )
    hint = "; did you mean --metres? As metres, start and goal are free places"
    error = refusal(tmp_path / "map.yaml", start=start, goal=(5, -3))
    assert (hint in str(error)) == asked
    assert hint not in str(refusal(rooms(30), start=start, goal=(5, -3)))
