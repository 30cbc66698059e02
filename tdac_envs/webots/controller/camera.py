"""Cameras: the simulation renders an image when a controller asks for it."""

from __future__ import annotations

import math
from typing import Any

from .calls import constants, getters, lacking
from .messages import complain, once
from .png import png
from .viewing import ViewingSensor


@getters("width", "height", "fov", "near")
@constants(hasRecognition=False)
@lacking(
    setFov=None,
    getMinFov=math.nan,
    getMaxFov=math.nan,
    getExposure=math.nan,
    setExposure=None,
    getFocalLength=0.0,
    getFocalDistance=0.0,
    setFocalDistance=None,
    getMinFocalDistance=0.0,
    getMaxFocalDistance=0.0,
    recognitionEnable=None,
    recognitionDisable=None,
    getRecognitionSamplingPeriod=0,
    hasRecognitionSegmentation=False,
    enableRecognitionSegmentation=None,
    disableRecognitionSegmentation=None,
    isRecognitionSegmentationEnabled=False,
    getRecognitionSegmentationImage=None,
    getRecognitionSegmentationImageArray=None,
    saveRecognitionSegmentationImage=-1,
    getRecognitionObjects=(),
    getRecognitionNumberOfObjects=0,
)
class Camera(ViewingSensor):
    """A colour camera."""

    _c_name = "camera"
    setFov: Any

    def getImage(self) -> bytes | None:
        """The last image: blue, green, red and 255 of each pixel, row by row.

        As in Webots, the image is black before the first sample. It is None before the
        first step, and None with an error if the camera is disabled.
        """
        return self._last("get_image")

    def getImageArray(self) -> list[list[list[int]]] | None:
        """The last image as `array[x][y]`: red, green, blue; None as in `getImage`."""
        image, width = self._last("get_image"), self.width
        if image is None:
            return None
        return [
            [
                [image[at + 2], image[at + 1], image[at]]
                for at in range(4 * x, len(image), 4 * width)
            ]
            for x in range(width)
        ]

    @staticmethod
    def imageGetRed(image: bytes, width: int, x: int, y: int) -> int:
        """Red of a pixel of an image, 0 to 255."""
        return image[4 * (y * width + x) + 2]

    @staticmethod
    def imageGetGreen(image: bytes, width: int, x: int, y: int) -> int:
        """Green of a pixel of an image, 0 to 255."""
        return image[4 * (y * width + x) + 1]

    @staticmethod
    def imageGetBlue(image: bytes, width: int, x: int, y: int) -> int:
        """Blue of a pixel of an image, 0 to 255."""
        return image[4 * (y * width + x)]

    @staticmethod
    def imageGetGray(image: bytes, width: int, x: int, y: int) -> int:
        """Mean of red, green and blue of a pixel, rounded down."""
        return sum(image[4 * (y * width + x) : 4 * (y * width + x) + 3]) // 3

    imageGetGrey = imageGetGray

    def saveImage(self, filename: str, quality: int) -> int:
        """Writes the last image to a PNG file; returns 0, or -1 if there is none.

        Args:
            filename: Path; with another suffix than ".png", a message is printed.
            quality: Has no effect, because PNG is lossless.
        """
        del quality
        image = self._last("save_image")
        if image is None:
            return -1
        if not filename.lower().endswith(".png"):
            once("tdac: Camera.saveImage() writes a PNG file, whatever its name is")
        try:
            with open(filename, "wb") as file:
                file.write(png(image, self.width, self.height))
        except OSError as error:
            complain(f"Error: wb_camera_save_image() failed: {error}")
            return -1
        return 0

    @property
    def image(self) -> bytes | None:
        """See `getImage`."""
        return self._last("get_image")

    @property
    def fov(self) -> float:
        """Horizontal field of view, rad; setting it has no effect."""
        return float(self._facts.get("fov", math.nan))

    @fov.setter
    def fov(self, angle: float) -> None:
        self.setFov(angle)

    @property
    def near(self) -> float:
        """Distance of the near plane, m."""
        return float(self._facts.get("near", math.nan))
