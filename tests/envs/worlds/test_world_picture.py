"""Promises of the picture of a world."""

import cv2
import numpy as np
import pytest
from world_texts import EVERYTHING, text

from tdac_envs import read_world
from tdac_envs.drawing.canvas import FREE, GREEN, RED, TRAIL, WALL
from tdac_envs.worlds.picture import SIDE, WorldCanvas, draw_world


def share(image, colour):
    """Part of the picture that has a colour."""
    return float((np.abs(image.astype(int) - colour).max(axis=2) <= 3).mean())


@pytest.mark.parametrize(
    "source",
    [
        text(),
        text("E-puck { translation 100 50 0 }"),
        text("RectangleArena { floorSize 20 0.1 }"),
        text("RectangleArena { floorSize 0.1 20 }", "E-puck { }"),
        EVERYTHING,
    ],
    ids=["empty", "robot", "wide", "tall", "everything"],
)
def test_any_world_can_be_drawn(source):
    """RGB bytes, sides even, never larger than a screen."""
    image = draw_world(read_world(source))
    rows, columns, channels = image.shape
    assert image.dtype == np.uint8
    assert channels == 3
    assert rows % 2 == columns % 2 == 0
    assert max(rows, columns) <= SIDE + 80


def test_places_are_where_they_should_be():
    """x to the right, y up; a box is painted over its footprint and nowhere else."""
    world = read_world(
        text("RectangleArena { floorSize 2 2 }",
             "WoodenBox { translation 0.5 0.25 0.05 size 0.4 0.2 0.1 }")
    )  # fmt: skip
    image, view = draw_world(world), WorldCanvas((-1.01, -1.01, 1.01, 1.01))
    wood = (np.abs(image.astype(int) - (190, 146, 94)).max(axis=2) <= 8)[
        : -view.canvas.image.shape[0] + SIDE
    ]
    rows, columns = np.nonzero(wood)
    (left, top), (right, low) = view.at([(0.3, 0.35), (0.7, 0.15)])
    assert columns.min() == pytest.approx(left, abs=2.5)
    assert columns.max() == pytest.approx(right, abs=2.5)
    assert rows.min() == pytest.approx(top, abs=2.5)
    assert rows.max() == pytest.approx(low, abs=2.5)
    assert wood.sum() == pytest.approx((right - left) * (low - top), rel=0.05)


def test_a_robot_points_where_it_drives():
    """Up on the screen at heading pi / 2."""
    pictures = [
        draw_world(
            read_world(text(f"CircleArena {{ }} E-puck {{ rotation 0 0 1 {turn} }}"))
        )
        for turn in (0, 1.5707963267948966)
    ]
    turned = cv2.rotate(pictures[0][:SIDE], cv2.ROTATE_90_COUNTERCLOCKWISE)
    middle = np.s_[SIDE // 2 - 14 : SIDE // 2 + 14, SIDE // 2 - 14 : SIDE // 2 + 14]
    off = np.abs(turned[middle].astype(int) - pictures[1][:SIDE][middle])
    assert (off > 60).mean() < 0.08
    assert share(pictures[1], TRAIL) > 0


def test_everything_has_its_mark():
    """Walls, floor, goal, and what is not modelled."""
    arena = "RectangleArena { wallThickness 0.05 }"
    plain = draw_world(read_world(text(arena)))
    assert share(plain, WALL) > 0.05
    assert share(plain, FREE) > 0.4
    assert share(plain, GREEN) == share(plain, RED) == 0
    goal = draw_world(read_world(text(arena, "DEF GOAL Pose { }")))
    assert share(goal, GREEN) > 1e-4
    dragon = draw_world(read_world(text(arena, "Dragon { }")))
    assert share(dragon, RED) > 1e-4


def test_what_cannot_be_hit_is_pale():
    """Overhead, or not solid."""
    box = "SolidBox {{ translation 0 0 {} size 0.3 0.3 0.1 }}"
    steel = (98, 108, 126)
    low, high = (
        draw_world(
            read_world(
                text(
                    "RectangleArena { }",
                    "E-puck { translation 0.4 0 0 }",
                    box.format(z),
                )
            )
        )
        for z in (0.05, 0.5)
    )
    assert share(low, steel) > 0.05
    assert share(high, steel) < 0.01
    ghost = draw_world(
        read_world(
            text("RectangleArena { }", "Shape { geometry Box { size 0.3 0.3 0.1 } }")
        )
    )
    assert share(ghost, steel) == 0
    assert (ghost != draw_world(read_world(text("RectangleArena { }")))).any()
