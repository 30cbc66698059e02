"""The narrowest passage of a path, against a search of all gaps of a map."""

import cv2
import numpy as np
import pytest

pytest.importorskip("nicegui", reason="needs tdac[studio]")

from tdac_agent.studio.bottleneck import corners_of
from tdac_agent.studio.draft import TaskDraft, check
from tdac_agent.studio.source_view import view_of


def blocks(random):
    """A picture with black rectangles."""
    picture = np.full((70, 70), 255, np.uint8)
    for x, y, width, height in random.integers((3, 3, 2, 2), (67, 67, 14, 14), (7, 4)):
        picture[y : y + height, x : x + width] = 0
    picture[:2] = picture[-2:] = picture[:, :2] = picture[:, -2:] = 0
    return picture


def cross(one, other):
    return one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]


def smallest_gap(cells, path):
    """Of all free lines between two walls: the shortest one that the path crosses.

    An end of the path needs room, too.
    """
    walls = corners_of(cells)
    room = min(np.hypot(*(walls - end).T).min() for end in (path[0], path[-1]))
    first, second = np.triu_indices(len(walls), 1)
    lengths = np.hypot(*(walls[first] - walls[second]).T)
    begins, ends = path[:-1], path[1:]
    for pair in np.argsort(lengths):
        if lengths[pair] >= 2.0 * room:
            break
        one, other = walls[first[pair]], walls[second[pair]]
        apart = cross(other - one, begins - one) * cross(other - one, ends - one) < 0
        legs = ends - begins
        across = cross(legs, one - begins) * cross(legs, other - begins) < 0
        if np.count_nonzero(apart & across) % 2 == 0:
            continue
        shares = np.linspace(0, 1, int(8 * lengths[pair]) + 2)[1:-1, None]
        columns, rows = np.floor(one + shares * (other - one) + 0.5).astype(int).T
        if not cells[rows, columns].any():
            return lengths[pair]
    return 2.0 * room


@pytest.mark.slow
def test_it_is_the_smallest_gap_that_the_path_crosses(tmp_path):
    random, places = np.random.default_rng(0), []
    while len(places) < 8:
        cv2.imwrite(str(tmp_path / "map.png"), blocks(random))
        view = view_of("map", str(tmp_path / "map.png"), "dark")
        start, goal = random.integers(5, 65, (2, 2)).astype(float).tolist()
        draft = TaskDraft("map", "map.png", tuple(start), tuple(goal), 0.0, 2.0, "dark")
        checked = check(draft, view, tmp_path)
        if checked.task is None:  # start or goal is in a block
            continue
        places.append(checked.narrowest.at)
        gap = smallest_gap(checked.task.nominal.terrain.grid.cells, checked.path)
        assert checked.narrowest.width == pytest.approx(gap, abs=0.25)
    assert {"path", "start", "goal"} == set(places)
