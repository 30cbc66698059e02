"""The negative of a drawing has the other polarity and the same obstacles."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tdac_envs.mapping.binarize import otsu, unknown_level
from tdac_envs.mapping.image import ColourImage, GreyImage, luminance
from tdac_envs.mapping.lighting import photographed
from tdac_envs.mapping.map_files import load_image
from tdac_envs.mapping.preprocessing import preprocess, rank_candidates
from tdac_envs.mapping.scene import MapReading

REAL_MAPS = Path(__file__).parents[4] / "shared" / "data" / "maps"
START, GOAL, RADIUS = (40, 40), (260, 160), 9.0
OTHER = {"dark": "light", "light": "dark", "mixed": "mixed"}

Point = tuple[int, int]


def plan(
    seed: int, wall: int, floors: int, blur: float, jpeg: int | None
) -> ColourImage:
    """Rooms with doors: floors of several colours, smoothed lines, words, marks."""
    rng = np.random.default_rng(seed)
    tones = rng.integers(200, 256, (floors, 3))
    page = np.repeat(tones, -(-300 // floors), axis=0)[:300].astype(np.uint8)
    image = np.repeat(page[None], 200, axis=0)
    ink = tuple(rng.integers(0, 90, 3).tolist())
    cv2.rectangle(image, (8, 8), (291, 191), ink, wall)
    for x, y in ((100, 8), (200, 191)):
        cv2.line(image, (x, y), (x + 9, 100), ink, wall, cv2.LINE_AA)
    cv2.putText(image, "room 12", (120, 60), 0, 0.5, ink, 1, cv2.LINE_AA)
    cv2.circle(image, START, 5, (220, 20, 20), -1, cv2.LINE_AA)
    if blur:
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), blur), np.uint8)
    if jpeg is None:
        return image
    data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, jpeg])[1]
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), np.uint8)


def both(
    image: ColourImage, start: Point, goal: Point, radius: float
) -> tuple[MapReading, MapReading]:
    """The chosen readings of a picture and of its negative."""
    one, other = (
        rank_candidates(each, start, goal, radius)[0].reading
        for each in (image, 255 - image)
    )
    return one, other


def check_mirrored(
    image: ColourImage, start: Point, goal: Point, radius: float
) -> None:
    """Only the polarity differs, with the task and without one."""
    one, other = both(image, start, goal, radius)
    assert other.polarity == OTHER[one.polarity]
    np.testing.assert_array_equal(one.cells, other.cells)
    alone, negative = (
        preprocess(each, robot_radius=radius) for each in (image, 255 - image)
    )
    assert negative[1].polarity == OTHER[alone[1].polarity]
    np.testing.assert_array_equal(alone[0].cells, negative[0].cells)


@given(
    seed=st.integers(0, 10_000),
    wall=st.sampled_from([1, 2, 3, 5, 9]),
    floors=st.sampled_from([1, 1, 3, 6]),
    blur=st.sampled_from([0.0, 0.6, 1.0]),
    jpeg=st.sampled_from([None, None, 95]),
)
@settings(derandomize=True, deadline=None, max_examples=20)
def test_drawings(
    seed: int, wall: int, floors: int, blur: float, jpeg: int | None
) -> None:
    """Thin or thick, sharp or smoothed, on floors of one colour or of many."""
    check_mirrored(plan(seed, wall, floors, blur, jpeg), START, GOAL, RADIUS)


def tasks() -> list:
    """The tasks on real maps, without those that differ in the radius alone."""
    index = REAL_MAPS / "index.json"
    found = json.loads(index.read_text()) if index.is_file() else []
    return [task for task in found if task["expected"] == "feasible"]


def real(task: dict) -> ColourImage:
    file = task["png"] if task["kind"] == "movingai" else task["file"]
    return load_image(REAL_MAPS / file).colour


QUICK = ("img_fp_example4_gray", "img_mazecv_tc_coloured", "img_hog2_hrt201n_jpg")


@pytest.mark.skipif(not tasks(), reason="the real maps are not on this machine")
@pytest.mark.parametrize(
    "task",
    [
        pytest.param(
            task,
            id=task["name"],
            marks=[] if task["name"] in QUICK else pytest.mark.slow,
        )
        for task in tasks()
    ],
)
def test_real_drawings(task: dict) -> None:
    """All shared maps, none of which is a photograph."""
    radius = max(min(12, task["max_robot_radius_px"] - 1), 2)
    check_mirrored(real(task), tuple(task["start"]), tuple(task["goal"]), radius)


def in_grey(*bands: tuple[int, int]) -> GreyImage:
    """A picture of bands, each a level and a height."""
    return np.concatenate([np.full((n, 60), level, np.uint8) for level, n in bands])


@pytest.mark.parametrize(
    "grey",
    [
        in_grey((0, 20), (127, 20), (254, 20)),
        in_grey((0, 20), (255, 20)),
        in_grey((10, 5), (200, 60), (201, 60)),
    ],
)
def test_threshold(grey: GreyImage) -> None:
    """Of two equally good thresholds, a picture and its negative have the same one."""
    negative = 255 - grey
    np.testing.assert_array_equal(grey > otsu(grey), negative <= otsu(negative))


def test_unknown_grey() -> None:
    """If both usual greys stand out, the commoner one counts in either picture."""
    grey = in_grey((255, 50), (0, 20), (205, 20), (50, 30))
    assert unknown_level(grey) == 50
    assert unknown_level(255 - grey) == 205


def test_a_negative_drawing_is_no_photograph() -> None:
    """Smoothed light lines have many levels, and a dark page few: so has a drawing."""
    page = luminance(plan(0, 2, 6, 1.0, None))
    assert not photographed(page)
    assert not photographed(255 - page)
