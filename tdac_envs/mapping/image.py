"""Loads map files; obstacles that a file does not define are inferred later."""

from __future__ import annotations

import io
import warnings
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tdac_envs.core.errors import MapError, file_hint
from tdac_envs.core.hashing import sha256_of
from tdac_envs.core.intake import IMAGE_BYTES, one_line, printable, read_file
from tdac_envs.grid.grid import BoolGrid

if TYPE_CHECKING:
    from PIL import Image

MAX_PIXELS = 64_000_000
"""Largest number of pixels of a picture."""

# Formats that Pillow decodes without starting a helper process.
_FORMATS = ("PNG", "JPEG", "PPM", "BMP", "GIF", "TIFF", "WEBP")

_BT709 = np.array([0.2126, 0.7152, 0.0722], np.float32)

GreyImage = NDArray[np.uint8]
ColourImage = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, eq=False)
class MapImage:
    """A decoded map.

    Attributes:
        colour: Shape (height, width, 3), uint8, RGB, alpha composited.
        name: File name, or "array".
        sha256: Hash of the bytes of the file or the array.
        occupied: Shape (height, width), bool, True = occupied, if the file defines the
            obstacles; None if they must be inferred from the picture.
        method: The rule of the file that gave `occupied`.
        resolution: Metres per pixel, or None.
        origin: Pose (x, y, yaw) of the lower-left pixel, m and rad.
        unknown: Shape (height, width), bool: occupied pixels of which the file says
            that they are unknown; None if it does not say so.
        notes: What a user should know about the file.
    """

    colour: ColourImage
    name: str
    sha256: str
    occupied: BoolGrid | None = None
    method: str = ""
    resolution: float | None = None
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    unknown: BoolGrid | None = None
    notes: tuple[str, ...] = ()

    @property
    def height(self) -> int:
        """Number of rows, px."""
        return int(self.colour.shape[0])

    @property
    def width(self) -> int:
        """Number of columns, px."""
        return int(self.colour.shape[1])

    def __post_init__(self) -> None:
        height, width = self.colour.shape[:2]
        if height < 2 or width < 2:
            raise MapError(
                f"{self.name}: {width} x {height} pixels are too few for a map; "
                "expected at least 2 x 2"
            )
        flat = self.colour.reshape(-1, 3)
        if self.occupied is None and np.array_equal(flat[1:], flat[:-1]):
            raise MapError(
                f"{self.name}: every pixel has the same colour "
                f"{tuple(int(c) for c in flat[0])}, so there are no walls to see; "
                "give an image with free space and obstacles"
            )


def luminance(colour: ColourImage) -> GreyImage:
    """Luminance by ITU-R BT.709, rounded, shape (height, width), uint8."""
    return np.asarray(np.rint(colour @ _BT709), np.uint8)


def read_picture(path: Path) -> MapImage:
    """Reads a PNG, JPEG, PGM, BMP, GIF, TIFF or WebP file of any depth."""
    data = read_bytes(path)
    return MapImage(decode(data, path.name), printable(path.name), sha256_of(data))


def from_array(array: NDArray[np.generic]) -> MapImage:
    """A map from an array.

    Args:
        array: bool (height, width), True = occupied; or uint8 of shape
            (height, width), (height, width, 3) RGB or (height, width, 4) RGBA.
    """
    digest = sha256_of(np.ascontiguousarray(array).tobytes())
    if array.dtype == np.bool_ and array.ndim == 2:
        occupied = np.asarray(array, np.bool_)
        shade = np.where(occupied, 0, 255).astype(np.uint8)
        return MapImage(_stack(shade), "array", digest, occupied, "given")
    depth = array.shape[2] if array.ndim == 3 else 1
    if array.dtype != np.uint8 or array.ndim not in {2, 3} or depth not in {1, 3, 4}:
        raise MapError(
            "expected a bool array (height, width) or a uint8 array (height, width), "
            f"(height, width, 3) or (height, width, 4), got {array.dtype} {array.shape}"
        )
    pixels = np.asarray(array, np.uint8).reshape(*array.shape[:2], depth)
    if depth == 4:
        return MapImage(composite(pixels), "array", digest)
    return MapImage(pixels if depth == 3 else _stack(pixels[..., 0]), "array", digest)


def read_bytes(path: Path, most: int = IMAGE_BYTES) -> bytes:
    """The file's bytes; raises MapError if it cannot be read."""
    try:
        return read_file(path, most)
    except FileNotFoundError:
        raise MapError(
            f"{path}: no such file{file_hint(path)}; check the path"
        ) from None
    except IsADirectoryError:
        raise MapError(f"{path}: is a folder; give the map file in it") from None
    except OSError as error:
        raise MapError(f"{path}: cannot be read: {error.strerror}") from error


def check_size(name: str, width: int, height: int) -> None:
    """Raises MapError if a picture has more than `MAX_PIXELS`."""
    if width * height > MAX_PIXELS:
        raise MapError(
            f"{name}: {width} x {height} pixels are {width * height / 1e6:.0f} "
            f"megapixels; the limit is {MAX_PIXELS / 1e6:.0f}: scale it down first"
        )


def decode(data: bytes, name: str) -> ColourImage:
    """The picture in a file's bytes, RGB, alpha composited.

    The size is checked from the header, before any pixel is decoded.
    """
    from PIL import ImageOps

    with _opened(data, name) as picture:
        return _to_rgb(ImageOps.exif_transpose(picture))


def decode_stored(data: bytes, name: str) -> NDArray[np.uint8]:
    """The stored values of a picture's pixels, for files that define their meaning.

    Colours are kept where alpha hides them; 16-bit grey is divided by 257, however dark
    the picture is.

    Returns:
        Shape (height, width, 4), uint8, RGBA.
    """
    from PIL import ImageOps

    with _opened(data, name) as picture:
        return _stored(ImageOps.exif_transpose(picture))


def picture_size(data: bytes, name: str) -> tuple[int, int]:
    """Width and height of the picture in a file's bytes, from its header."""
    with _opened(data, name) as picture:
        return picture.size


@contextmanager
def _opened(data: bytes, name: str) -> Generator[Image.Image]:
    """Opens the picture in a file's bytes; every error is a MapError."""
    from PIL import Image, UnidentifiedImageError

    try:
        with warnings.catch_warnings():
            # Pillow's size warning is replaced by `check_size`; its size error is not.
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            picture = Image.open(io.BytesIO(data), formats=_FORMATS)
            check_size(name, *picture.size)
            yield picture
    except Image.DecompressionBombError:
        raise MapError(
            f"{name}: more than {MAX_PIXELS / 1e6:.0f} megapixels: scale it down first"
        ) from None
    except UnidentifiedImageError:
        raise MapError(
            f"{name}: not an image; expected PNG, JPEG, PGM or BMP, a ROS map.yaml "
            "or a MovingAI .map"
        ) from None
    except MapError:
        raise
    # Pillow raises dozens of error types for a damaged file.
    except Exception as error:
        raise MapError(
            f"{name}: the image is damaged ({one_line(error)}); save it again"
        ) from error


def _to_rgb(picture: Image.Image) -> ColourImage:
    if picture.mode.startswith(("I", "F")):
        return _stack(_to_eight_bits(np.asarray(picture, np.float64)))
    if picture.mode in {"LA", "PA", "La", "RGBA", "RGBa"} or (
        "transparency" in picture.info
    ):
        return composite(np.asarray(picture.convert("RGBA"), np.uint8))
    return np.array(picture.convert("RGB"), np.uint8)


def _stored(picture: Image.Image) -> NDArray[np.uint8]:
    if not picture.mode.startswith(("I", "F")):
        return np.asarray(picture.convert("RGBA"), np.uint8)
    values = np.asarray(picture, np.float64)
    is_deep = picture.mode[0] == "I" and 0 <= values.min() <= values.max() <= 65535
    scaled = np.rint(values / 257.0) if is_deep else _to_eight_bits(values)
    clear = values == picture.info.get("transparency")
    grey = scaled.astype(np.uint8)
    return np.dstack([grey, grey, grey, np.where(clear, np.uint8(0), np.uint8(255))])


def _to_eight_bits(values: NDArray[np.float64]) -> GreyImage:
    """Scales grey values to 0..255; 8-bit values are kept."""
    low, high = float(values.min()), float(values.max())
    if low < 0 or high > 65535:
        values, high = values - low, high - low
        return np.asarray(np.rint(values * (255.0 / max(high, 1.0))), np.uint8)
    if 0 < high <= 1.0:
        return np.asarray(np.rint(values * 255.0), np.uint8)
    return np.asarray(np.rint(values if high <= 255 else values / 257.0), np.uint8)


def composite(rgba: NDArray[np.uint8]) -> ColourImage:
    """Composites RGBA over white, or over black for light ink on a transparent page."""
    alpha = rgba[..., 3:].astype(np.float32) / 255.0
    inked = rgba[..., :3] * alpha
    over_white = np.rint(inked + 255.0 * (1.0 - alpha)).astype(np.uint8)
    if alpha.min() < 1.0 and int(np.ptp(luminance(over_white))) < 16:
        return np.asarray(np.rint(inked), np.uint8)
    return np.asarray(over_white, np.uint8)


def _stack(grey: GreyImage) -> ColourImage:
    return np.repeat(grey[..., None], 3, axis=2)
