"""How a map was read, in words."""

import numpy as np
import pytest

from tdac_envs.mapping.preprocessing import preprocess
from tdac_envs.mapping.scene import MapReading
from tdac_envs.mapping.wording import obstacles_text

CELLS = np.zeros((2, 2), np.bool_)


@pytest.mark.parametrize(
    ("polarity", "method", "threshold", "text"),
    [
        (
            *("dark", "otsu", 127.0),
            "dark pixels (brightness up to 127 of 255, a threshold by Otsu's method)",
        ),
        (
            *("light", "threshold as given, polarity as given", 90.0),
            "light pixels as chosen (brightness above 90 of 255, a threshold as given)",
        ),
        (
            *("dark", "light evened, marks ignored", None),
            "dark pixels (after uneven light was corrected); ignored: marks",
        ),
        (
            "dark",
            "otsu, unknown grey 205 not free, outside of the plan closed",
            205.5,
            "dark pixels (brightness up to 205.5 of 255, a threshold by Otsu's "
            "method), unknown areas (grey 205) and the area outside of the plan",
        ),
        (
            *("mixed", "colour unlike the floor, specks up to 4 px ignored", None),
            "pixels whose colour differs from the floor; ignored: specks up to 4 px",
        ),
        ("given", "ros trinary", None, "all pixels that the ROS file does not define "),
        ("given", "given", None, "those of the grid"),
        ("dark", "", None, "dark pixels ()"),
    ],
)
def test_a_reading_is_a_sentence(polarity, method, threshold, text):
    """Which pixels are obstacles, by which threshold, and what was ignored."""
    reading = MapReading(CELLS, polarity, method, threshold)
    assert obstacles_text(reading).startswith(f"obstacles are {text}")


def test_no_note_of_a_reading_is_lost():
    """Walls in strong colours appear in the sentence."""
    picture = np.full((120, 200, 3), 255, np.uint8)
    picture[20:24, 20:180] = picture[96:100, 20:180] = (0, 0, 200)
    picture[20:100, 20:24] = picture[20:100, 176:180] = (0, 0, 200)
    picture[20:60, 98:102] = (230, 220, 0)
    _, params = preprocess(picture, (60, 60), (140, 60), 8.0)
    assert params.method == "otsu, coloured walls"
    assert obstacles_text(params).endswith("Otsu's method) and coloured walls")
