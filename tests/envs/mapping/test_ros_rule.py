"""ROS maps: which pixels are free and unknown, as nav2's map server has it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from tdac_envs.core.errors import MapError
from tdac_envs.mapping.image import MapImage
from tdac_envs.mapping.map_files import load_image
from tdac_envs.mapping.preprocessing import preprocess

LEVELS = np.arange(256, dtype=np.uint8)
GREYS, ALPHAS = np.meshgrid(LEVELS, LEVELS)
PAIRS = np.dstack([GREYS, GREYS, GREYS, ALPHAS])
"""Every grey with every alpha, shape (256, 256, 4)."""


def read(folder: Path, picture: NDArray[np.generic], **fields: object) -> MapImage:
    """The map of a picture and the fields of its yaml file."""
    Image.fromarray(picture).save(folder / "map.png")
    given = {"image": "map.png", "resolution": 0.05, **fields}
    text = "\n".join(f"{key}: {value}" for key, value in given.items())
    (folder / "map.yaml").write_text(text + "\n")
    return load_image(folder / "map.yaml")


def cell(
    grey: int, alpha: int, mode: str, negate: bool, free: float, occupied: float
) -> str:
    """One cell by the documented rule of nav2_map_server, in single precision."""
    if mode == "raw":
        if grey > 100:
            return "unknown"
        return "free" if np.float32(grey) / 100 <= np.float32(free) else "occupied"
    if alpha < 255:
        return "unknown"
    light = np.float32(grey) / np.float32(255)
    occupancy = light if negate else np.float32(1) - light
    if occupancy <= np.float32(free):
        return "free"
    between = occupancy < np.float32(occupied)
    return "unknown" if between and mode == "trinary" else "occupied"


@pytest.mark.parametrize("mode", ["trinary", "scale", "raw"])
@pytest.mark.parametrize("negate", [False, True])
@pytest.mark.parametrize(
    ("free", "occupied"),
    [(0.196, 0.65), (0.25, 0.65), (0.2, 0.6), (0.0, 1.0), (0.4, 0.4), (0.9, 0.1)],
)
def test_every_grey_and_alpha(
    mode: str, negate: bool, free: float, occupied: float, tmp_path: Path
) -> None:
    """Free and unknown cells agree with an independent reading of nav2's rule."""
    fields = {"free_thresh": free, "occupied_thresh": occupied, "negate": int(negate)}
    image = read(tmp_path, PAIRS, mode=mode, **fields)
    rule = [
        [cell(grey, alpha, mode, negate, free, occupied) for grey in range(256)]
        for alpha in (254, 255)
    ]
    want = np.where(ALPHAS == 255, np.array(rule[1]), np.array(rule[0]))
    np.testing.assert_array_equal(image.occupied, want != "free")
    np.testing.assert_array_equal(image.unknown, want == "unknown")


def test_deep_grey_counts_by_its_depth(tmp_path: Path) -> None:
    """16 bits are divided by 257, even if the picture is dark: 255 is nearly black."""
    deep = np.array([[0, 255, 52_428, 52_685, 65_535]] * 2, np.uint16)
    image = read(tmp_path, deep)
    np.testing.assert_array_equal(image.occupied, [[1, 1, 1, 1, 0]] * 2)
    image = read(tmp_path, deep, free_thresh=0.2)
    np.testing.assert_array_equal(image.occupied, [[1, 1, 0, 0, 0]] * 2)


@pytest.mark.parametrize("picture", ["palette", "grey and alpha"])
def test_all_kinds_of_transparency_are_unknown(picture: str, tmp_path: Path) -> None:
    """Whether a palette or a channel has it: what is under it does not matter."""
    clear = np.zeros((6, 8), np.bool_)
    clear[2:4] = True
    shades = np.full((6, 8), 255, np.uint8)
    if picture == "palette":
        image = Image.frombytes(
            "P", clear.shape[::-1], clear.astype(np.uint8).tobytes()
        )
        image.putpalette([255, 255, 255, 255, 255, 255])
        image.save(tmp_path / "map.png", transparency=1)
    else:
        layers = np.dstack([shades, np.where(clear, 0, 255).astype(np.uint8)])
        Image.fromarray(layers).save(tmp_path / "map.png")
    (tmp_path / "map.yaml").write_text("image: map.png\nresolution: 0.05\n")
    read_back = load_image(tmp_path / "map.yaml")
    np.testing.assert_array_equal(read_back.occupied, clear)
    np.testing.assert_array_equal(read_back.unknown, clear)


SHADES = np.array([[0, 205, 254, 254]] * 3, np.uint8)


@pytest.mark.parametrize("mode", ["Trinary", "SCALE", "Raw"])
def test_the_mode_may_be_written_in_capitals(mode: str, tmp_path: Path) -> None:
    image = read(tmp_path, SHADES, mode=mode)
    assert image.method == f"ros {mode.lower()}"


@pytest.mark.parametrize(
    ("fields", "notes"),
    [({}, 0), ({"free_thresh": 0.25}, 1), ({"free_thresh": 0.25, "negate": 1}, 0)],
)
def test_unknown_grey_that_is_free_has_a_note(
    fields: dict, notes: int, tmp_path: Path
) -> None:
    """The map saver's 205 is free by a threshold of 0.25, which one line says."""
    image = read(tmp_path, SHADES, **fields)
    found = preprocess(image)[1].notes
    assert len(found) == notes
    for note in found:
        assert "grey 205" in note
        assert "free_thresh 0.25 (25% of the pixels)" in note


def test_no_free_pixel_is_said_in_one_line(tmp_path: Path) -> None:
    """A threshold of 0 leaves white alone free; without white, nothing is."""
    assert not read(tmp_path, SHADES + 1, free_thresh=0.0).occupied[:, 2].any()
    with pytest.raises(MapError, match=r"no pixel counts as free by free_thresh 0,"):
        read(tmp_path, SHADES, free_thresh=0.0)
