"""Start and goal that are moved to free places, and words that cover them."""

import math

import cv2
import numpy as np
import pytest

from tdac_envs.core.errors import TaskError
from tdac_envs.grid.grid import OccupancyGrid, body_free, clearance
from tdac_envs.grid.map_units import MapUnits
from tdac_envs.grid.pieces import nearest_free
from tdac_envs.mapping.lettering import without_lettering
from tdac_envs.mapping.preprocessing import preprocess
from tdac_envs.mapping.score import connected
from tdac_envs.mapping.snapping import body_fits, snap

GOAL, RADIUS = (350, 250), 8.0
REACH = ", the nearest free pixel from which the goal can be reached"


def rooms():
    """Two rooms with a door between them, True = occupied."""
    cells = np.zeros((300, 400), np.bool_)
    cells[:6] = cells[-6:] = cells[:, :6] = cells[:, -6:] = True
    cells[:200, 195:203] = True
    return cells


def picture(cells):
    return np.where(cells, 0, 255).astype(np.uint8)


def written(text, at, scale=0.7, thickness=2):
    image = picture(rooms())
    cv2.putText(image, text, at, cv2.FONT_HERSHEY_SIMPLEX, scale, 0, thickness)
    return image


def with_closet():
    """A hollow pillar of 60 px, in which the body fits, but from which it cannot go."""
    cells = rooms()
    cells[80:140, 80:140] = True
    cells[86:134, 86:134] = False
    return cells


def test_what_is_free_stays_even_if_it_is_shut_in():
    """A free start is never moved: only the user knows whether it is meant."""
    assert snap(with_closet(), (110.25, 110), GOAL, RADIUS) == snap(
        rooms(), (110.25, 110), GOAL, RADIUS
    )


def test_a_start_in_the_wall_of_a_closet_leaves_it():
    """The inside is nearer, but the goal cannot be reached from there."""
    cells = with_closet()
    moved = snap(cells, (110, 84), GOAL, RADIUS)
    assert moved.goal == GOAL
    free = body_free(clearance(cells), RADIUS)
    assert connected(free, moved.start, GOAL)
    note = f"start moved from (110, 84) to {moved.start}{REACH}"
    why = "(110, 84) lies in an obstacle; across a wall: check the preview"
    assert moved.notes == (f"{note}; {why}",)


def test_both_ends_move_to_one_part_of_the_map():
    """Each alone would move into its own part."""
    cells = np.zeros((80, 200), np.bool_)
    cells[:, 98:102] = True
    moved = snap(cells, (96, 30), (103, 60), 6.0)
    free = body_free(clearance(cells), 6.0)
    assert moved.start != moved.goal
    assert moved.start is not None
    assert moved.goal is not None
    assert connected(free, moved.start, moved.goal)
    assert sum("across a wall" in note for note in moved.notes) == 1
    assert all(", a free pixel " in note for note in moved.notes)


def test_a_move_within_a_room_is_not_across_a_wall():
    moved = snap(rooms(), (186, 100), GOAL, 20.0)
    assert moved.notes == (f"start moved from (186, 100) to (174, 100){REACH}",)


def test_where_the_body_fits_nowhere_nothing_moves():
    moved = snap(rooms(), (3, 3), GOAL, 300.0)
    assert (moved.start, moved.goal, moved.notes) == ((3, 3), GOAL, ())


def test_notes_are_in_the_units_of_the_user():
    units = MapUnits.metres(OccupancyGrid(rooms(), 0.05, (-10.0, -5.0, 0.0)))
    moved = snap(rooms(), (186, 100), GOAL, 20.0, units)
    note = "start moved from (-0.675, 4.975) to (-1.275, 4.975)"
    assert moved.notes == (note + REACH.replace("pixel", "place"),)


def plainly(free, ends):
    """The pair of free pixels of one piece with the shortest total move, by force."""
    pixels = [(int(x), int(y)) for y, x in np.argwhere(free)]
    pairs = (
        (math.dist(a, ends[0]) + math.dist(b, ends[1]))
        for a in pixels
        for b in pixels
        if a != b and connected(free, a, b)
    )
    return min(pairs, default=None)


@pytest.mark.parametrize("seed", range(6))
def test_two_moves_are_the_shortest_together(seed):
    """Compared with all pairs of free pixels."""
    random = np.random.default_rng(seed)
    cells = random.random((10, 14)) < 0.15
    cells[3, 2] = cells[6, 11] = True
    start, goal = (2, 3), (11, 6)
    free = body_free(clearance(cells), 0.2)
    moved = snap(cells, start, goal, 0.2)
    total = math.dist(moved.start, start) + math.dist(moved.goal, goal)
    least = plainly(free, (start, goal))
    assert least is not None
    assert total == pytest.approx(least)
    assert connected(free, moved.start, moved.goal)


@pytest.mark.parametrize("seed", range(20))
def test_the_nearest_free_pixel_is_found_in_a_growing_window(seed):
    """Compared with all free pixels, for points on and off the map."""
    random = np.random.default_rng(seed)
    free = random.random((400, 300)) < random.choice([1e-5, 1e-4, 0.01])
    x, y = random.uniform(-500, 800, 2)
    rows, columns = np.nonzero(free)
    found = nearest_free(free, x, y)
    if rows.size == 0:
        assert found is None
    else:
        best = np.hypot(columns - x, rows - y).min()
        assert math.dist(found, (x, y)) == pytest.approx(best)
        assert free[found[1], found[0]]


@pytest.mark.parametrize("radius", [0.3, 2.0, 7.5])
def test_a_body_fits_where_the_clearance_says_so(radius):
    """The look at one place agrees with the clearance of the whole map."""
    cells = np.random.default_rng(3).random((40, 50)) < 0.01
    free = body_free(clearance(cells), radius)
    found = [[body_fits(cells, (x, y), radius) for x in range(50)] for y in range(40)]
    np.testing.assert_array_equal(found, free)


@pytest.mark.parametrize("radius", [1e10, 1e300, np.inf])
@pytest.mark.parametrize("snapping", [False, True])
def test_a_radius_beyond_every_map_is_refused(snapping, radius):
    """Also if its square or the radius itself is no longer a finite number."""
    with pytest.raises(TaskError, match="robot_radius"):
        preprocess(rooms(), (80, 84), GOAL, radius, snap=snapping)


@pytest.mark.parametrize("snapping", [False, True])
@pytest.mark.parametrize(
    ("text", "at", "scale", "start"),
    [("S", (60, 90), 0.6, (65, 84)), ("START", (40, 90), 0.7, (80, 84)),
     ("START", (30, 100), 1.2, (80, 84)), ("Start", (40, 90), 0.7, (70, 84))],
)  # fmt: skip
def test_words_over_the_start_are_no_obstacles(snapping, text, at, scale, start):
    """They are recognised with and without snap; the start stays where it is."""
    image = written(text, at, scale)
    grid, params = preprocess(image, start, GOAL, RADIUS, snap=snapping)
    assert params.start == start
    np.testing.assert_array_equal(grid.cells, rooms())
    assert params.notes == (
        "treated as free space: words over start or goal; check the preview",
    )


def test_a_word_over_the_start_goes_though_the_goal_is_snapped():
    """The move of one end does not bring back the word over the other."""
    image = written("START", (40, 90))
    grid, params = preprocess(image, (80, 84), (391, 250), RADIUS, snap=True)
    assert params.start == (80, 84)
    assert params.goal != (391, 250)
    np.testing.assert_array_equal(grid.cells, rooms())


def test_a_word_goes_though_its_own_end_is_snapped():
    """The start is on a word, and too near to a wall."""
    image = written("S", (8, 90), 0.6)
    grid, params = preprocess(image, (13, 84), GOAL, RADIUS, snap=True)
    assert params.start == (14, 84)
    np.testing.assert_array_equal(grid.cells, rooms())


def test_words_elsewhere_stay():
    image = written("ROOM", (40, 90))
    cells = image < 128
    assert without_lettering(cells, [(300, 100), (60, 200)]) is None


@pytest.mark.parametrize("shape", ["frame", "pillar", "bar", "wall"])
def test_what_is_no_word_stays(shape):
    """A frame, a pillar, a bar and a wall that covers the place."""
    cells = rooms()
    if shape == "frame":
        cells[80:100, 80:100] = True
        cells[82:98, 82:98] = False
    elif shape == "pillar":
        cells[84:96, 84:96] = True
    elif shape == "bar":
        cells[80:100, 89:92] = True
    place = (198, 90) if shape == "wall" else (90, 90)
    assert without_lettering(cells, [place]) is None
