"""Map files: every kind is read to the same picture, every bad one is refused."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tdac_envs.core.errors import MapError
from tdac_envs.grid.grid import OccupancyGrid
from tdac_envs.grid.metric import to_metres, to_pixels
from tdac_envs.mapping.image import from_array, luminance
from tdac_envs.mapping.map_files import load_image

WALLS = np.zeros((40, 60), np.bool_)
WALLS[:4] = WALLS[-4:] = WALLS[:, :4] = WALLS[:, -4:] = WALLS[10:30, 28:32] = True
GREY = np.where(WALLS, 0, 255).astype(np.uint8)


def _palette(path: Path) -> None:
    picture = Image.frombytes("P", WALLS.shape[::-1], WALLS.astype(np.uint8).tobytes())
    picture.putpalette([9, 9, 9, 0, 0, 0])
    picture.save(path, transparency=0)


def _ascii_pgm(path: Path) -> None:
    rows = "\n".join(" ".join(map(str, row)) for row in np.where(WALLS, 0, 100))
    path.write_text(f"P2\n# a comment\n60 40\n100\n{rows}\n")


def _alpha(*bands: np.ndarray) -> np.ndarray:
    """Black everywhere; only the walls are opaque."""
    return np.dstack([*bands, np.where(WALLS, 255, 0).astype(np.uint8)])


BLACK = np.zeros_like(GREY)
WRITERS = {
    "grey.png": lambda p: Image.fromarray(GREY).save(p),
    "one_bit.png": lambda p: Image.fromarray(~WALLS).save(p),
    "palette_trns.png": _palette,
    "sixteen.png": lambda p: Image.fromarray(GREY.astype(np.uint16) * 257).save(p),
    "grey_alpha.png": lambda p: Image.fromarray(_alpha(BLACK)).save(p),
    "rgba.png": lambda p: Image.fromarray(_alpha(BLACK, BLACK, BLACK)).save(p),
    "rgb.bmp": lambda p: Image.fromarray(np.dstack([GREY] * 3)).save(p),
    "binary.pgm": lambda p: Image.fromarray(GREY).save(p),
    "ascii.pgm": _ascii_pgm,
}


@pytest.mark.parametrize("name", WRITERS)
def test_lossless_kinds_read_alike(name: str, tmp_path: Path) -> None:
    WRITERS[name](tmp_path / name)
    image = load_image(tmp_path / name)
    np.testing.assert_array_equal(luminance(image.colour), GREY)
    assert image.name == name
    assert len(image.sha256) == 64


def test_jpeg_reads_nearly_alike(tmp_path: Path) -> None:
    Image.fromarray(GREY).save(tmp_path / "map.jpg", quality=90)
    got = luminance(load_image(tmp_path / "map.jpg").colour)
    np.testing.assert_array_equal(got > 127, ~WALLS)


def test_light_walls_on_a_transparent_sheet_are_seen(tmp_path: Path) -> None:
    """Over white nothing would be left of them."""
    white = np.full_like(GREY, 255)
    Image.fromarray(_alpha(white, white, white)).save(tmp_path / "map.png")
    got = luminance(load_image(tmp_path / "map.png").colour)
    np.testing.assert_array_equal(got, np.where(WALLS, 255, 0))


def test_luminance_is_bt709_rounded() -> None:
    colour = np.array([[[255, 0, 0], [0, 255, 0], [0, 0, 255], [1, 2, 3]]], np.uint8)
    np.testing.assert_array_equal(luminance(colour), [[54, 182, 18, 2]])


def test_exif_turned_photograph_is_read_as_it_is_shown(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.fromarray(GREY).save(tmp_path / "map.jpg", exif=exif)
    assert load_image(tmp_path / "map.jpg").colour.shape == (60, 40, 3)


def _ros(folder: Path, shades: np.ndarray, **fields: object) -> Path:
    (folder / "pictures").mkdir()
    Image.fromarray(shades).save(folder / "pictures" / "map.pgm")
    given = {"image": "pictures/map.pgm", "resolution": 0.05, **fields}
    given.setdefault("origin", [-1.0, -2.0, 0.0])
    text = "\n".join(f"{key}: {value}" for key, value in given.items())
    (folder / "map.yaml").write_text(text + "\n")
    return folder / "map.yaml"


SHADES = np.array([[0, 100, 205, 206, 254, 255]] * 2, np.uint8)


@pytest.mark.parametrize(
    ("fields", "occupied"),
    [
        ({}, [1, 1, 1, 0, 0, 0]),
        ({"free_thresh": 0.25}, [1, 1, 0, 0, 0, 0]),
        ({"negate": 1}, [0, 1, 1, 1, 1, 1]),
        ({"mode": "scale"}, [1, 1, 1, 0, 0, 0]),
        ({"mode": "raw"}, [0, 1, 1, 1, 1, 1]),
    ],
)
def test_ros_rules(fields: dict[str, object], occupied: list, tmp_path: Path) -> None:
    """Unknown is not free; free means an occupancy of at most `free_thresh`."""
    image = load_image(_ros(tmp_path, SHADES, **fields))
    np.testing.assert_array_equal(image.occupied, [occupied] * 2)
    assert image.resolution == 0.05
    assert image.origin == (-1.0, -2.0, 0.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("resolution: 0.05\n", "expected a field `image`"),
        ("image: map.pgm\nresolution: -1\n", "resolution: expected more than 0"),
        ("image: map.pgm\nresolution: 1\nmode: odd\n", "mode: Input should be"),
        ("image: none.pgm\nresolution: 1\n", "none.pgm: no such file"),
        ("image: [\n", "not valid YAML"),
    ],
)
def test_bad_ros_yaml(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text(text)
    with pytest.raises(MapError, match=message):
        load_image(tmp_path / "map.yaml")


def test_movingai(tmp_path: Path) -> None:
    path = tmp_path / "a.map"
    path.write_text("type octile\nheight 2\nwidth 5\nmap\n.GS@T\nWO...\n")
    image = load_image(path)
    np.testing.assert_array_equal(image.occupied, [[0, 0, 0, 1, 1], [1, 1, 0, 0, 0]])


@pytest.mark.parametrize(
    "header",
    [
        "type\toctile\nheight\t2\nwidth\t5\nmap\n",
        "Type Octile\nHEIGHT 2\nWidth 5\nMAP\n",
        "\ntype octile\n\nheight 2\nwidth 5\n\nmap\n\n",
        "type octile  \nheight  2 \nwidth 5\t\nmap \n",
        "type octile\r\nwidth 5\r\nheight 2\r\nmap\r\n",
    ],
)
def test_movingai_headers(header: str, tmp_path: Path) -> None:
    """Tabs, capitals, blank lines, spaces at the end and the order do not matter."""
    path = tmp_path / "a.map"
    path.write_bytes(f"{header}.GS@T\nWO...\n".encode())
    image = load_image(path)
    np.testing.assert_array_equal(image.occupied, [[0, 0, 0, 1, 1], [1, 1, 0, 0, 0]])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nothing", "not a MovingAI map"),
        ("type octile\nheight 2\nwidth x\nmap\n...\n", "not a MovingAI map"),
        ("type octile\nheight 2\nwidth 3\n...\n...\n", "not a MovingAI map"),
        ("type octile\nheight 2\nwidth 3\nmap\n...\n", "expected 2 rows of 3 cells"),
        ("type octile\nheight 9000\nwidth 9000\nmap\n", "81 megapixels"),
    ],
)
def test_bad_movingai(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "a.map").write_text(text)
    with pytest.raises(MapError, match=message):
        load_image(tmp_path / "a.map")


def _png_header(width: int, height: int) -> bytes:
    """The start of a PNG, with no pixels behind it."""
    chunk = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    size, check = struct.pack(">I", 13), struct.pack(">I", zlib.crc32(chunk))
    pixels = struct.pack(">I", 1 << 20) + b"IDAT"
    return b"\x89PNG\r\n\x1a\n" + size + chunk + check + pixels


@pytest.mark.parametrize(("width", "height"), [(10_000, 10_000), (60_000, 60_000)])
def test_huge_image_is_refused_by_its_header(
    width: int, height: int, tmp_path: Path
) -> None:
    (tmp_path / "huge.png").write_bytes(_png_header(width, height))
    with pytest.raises(MapError, match=r"huge\.png: .*megapixels.*scale it down"):
        load_image(tmp_path / "huge.png")


def test_broken_image(tmp_path: Path) -> None:
    Image.fromarray(GREY).save(tmp_path / "map.png")
    data = (tmp_path / "map.png").read_bytes()
    (tmp_path / "map.png").write_bytes(data[: len(data) // 2])
    with pytest.raises(MapError, match=r"map\.png: the image is damaged"):
        load_image(tmp_path / "map.png")


def test_not_an_image(tmp_path: Path) -> None:
    (tmp_path / "map.png").write_text("hello")
    with pytest.raises(MapError, match=r"map\.png: not an image; expected PNG"):
        load_image(tmp_path / "map.png")


def test_missing_file_and_folder(tmp_path: Path) -> None:
    with pytest.raises(MapError, match=r"none\.png: no such file"):
        load_image(tmp_path / "none.png")
    with pytest.raises(MapError, match="is a folder"):
        load_image(tmp_path)


def test_one_pixel(tmp_path: Path) -> None:
    Image.new("L", (1, 1)).save(tmp_path / "dot.png")
    with pytest.raises(MapError, match=r"dot\.png: 1 x 1 pixels are too few for a map"):
        load_image(tmp_path / "dot.png")


def test_one_colour(tmp_path: Path) -> None:
    Image.new("L", (50, 50)).save(tmp_path / "black.png")
    with pytest.raises(MapError, match=r"black\.png: every pixel has the same colour"):
        load_image(tmp_path / "black.png")


def test_wrong_array() -> None:
    with pytest.raises(MapError, match="expected a bool array"):
        from_array(np.zeros((4, 4), np.float64))


def test_metres_and_pixels_are_inverse() -> None:
    """The lower-left pixel's outer corner lies at the origin; y points up."""
    grid = OccupancyGrid(WALLS, 0.05, (-1.0, -2.0, 0.3))
    assert to_pixels(grid, -1.0, -2.0) == pytest.approx((-0.5, 39.5))
    assert to_pixels(grid, *to_metres(grid, 12.0, 7.0)) == pytest.approx((12.0, 7.0))
    level = OccupancyGrid(WALLS, 0.05)
    assert to_metres(level, 0.5, 38.5) == pytest.approx((0.05, 0.05))


def test_metres_need_a_resolution() -> None:
    with pytest.raises(MapError, match="no resolution"):
        to_pixels(OccupancyGrid(WALLS), 0.0, 0.0)
