"""The picture of the robot: round, two wheels, ultrasonic sensors along the nose."""

from __future__ import annotations

import math

import cv2
import numpy as np

from tools.draw_maps.ink import (
    Colour,
    Image,
    Point,
    arc,
    disc,
    line,
    polygon,
    sheet,
)

_SIZE = 128
_MIDDLE: Point = (63.5, 63.5)
_SHELL: Colour = (236, 240, 244)
_RIM: Colour = (38, 50, 66)
_TYRE: Colour = (26, 28, 32)
_ACCENT: Colour = (0, 128, 168)
_METAL: Colour = (176, 184, 192)


def draw_robot() -> Image:
    """The robot from above, RGBA: nose towards +x, body as wide as the image."""
    page, mask = sheet(_SIZE, _SIZE, _RIM), sheet(_SIZE, _SIZE, (0, 0, 0))
    disc(mask, _MIDDLE, 63, (255, 255, 255))
    disc(page, _MIDDLE, 58, _SHELL)
    disc(page, (61, 61), 46, (246, 249, 251))
    for side in (-1, 1):
        _wheel(page, 63.5 + side * 46)
    line(page, arc(_MIDDLE, 50, -64, 64), 16, (54, 70, 90))
    for degrees in (-55, -27.5, 0, 27.5, 55):
        _sensor(page, degrees)
    disc(page, (58, 63.5), 24, (22, 98, 84))
    disc(page, (58, 63.5), 22, (34, 126, 106))
    polygon(page, [(46, 52), (78, 63.5), (46, 75), (52, 63.5)], _SHELL)
    disc(page, (24, 63.5), 4, _ACCENT)
    size = (_SIZE, _SIZE)
    colour = cv2.resize(page, size, interpolation=cv2.INTER_AREA)
    alpha = cv2.resize(mask[..., :1], size, interpolation=cv2.INTER_AREA)
    return np.dstack([colour, alpha]).astype(np.uint8)


def _wheel(page: Image, y: float) -> None:
    """Draws a tyre with its tread, from above."""
    corners = [(44, y - 8), (83, y - 8), (83, y + 8), (44, y + 8)]
    line(page, corners, 4, _TYRE, closed=True)
    polygon(page, corners, _TYRE)
    for x in range(46, 84, 6):
        line(page, [(x, y - 7), (x, y + 7)], 1.5, (70, 74, 80))


def _sensor(page: Image, degrees: float) -> None:
    """Draws the two transducers of an ultrasonic sensor on the nose."""
    for offset in (-6.5, 6.5):
        angle = math.radians(degrees + offset)
        eye = (63.5 + 50 * math.cos(angle), 63.5 + 50 * math.sin(angle))
        disc(page, eye, 5, _METAL)
        disc(page, eye, 3.2, (30, 34, 40))
        disc(page, (eye[0] - 1, eye[1] - 1), 0.9, (230, 236, 240))
