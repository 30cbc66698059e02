"""The colours of pictures of episodes."""

import itertools

import numpy as np
import pytest
from skimage.color import rgb2lab

from tdac_envs.drawing.canvas import FREE, GREEN, MOVER, TRAIL, WALL
from tdac_envs.drawing.closeup import EVENT

# Machado, Oliveira and Fernandes 2009, severity 1, for linear RGB.
VISION = {
    "normal": np.eye(3),
    "without red": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "without green": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "without blue": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}


def linear(colour):
    value = np.array(colour) / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def seen_as(colour, matrix):
    """The colour as CIELAB of what somebody sees."""
    value = np.clip(np.array(matrix) @ linear(colour), 0.0, 1.0)
    shown = np.where(
        value <= 0.0031308, 12.92 * value, 1.055 * value ** (1 / 2.4) - 0.055
    )
    return rgb2lab(shown[None, None])[0, 0]


@pytest.mark.parametrize("kind", VISION)
def test_the_colours_are_told_apart_by_everybody(kind):
    """Free space, walls, the way, the goal, the contact and movers, pair by pair."""
    colours = (FREE, WALL, TRAIL, GREEN, EVENT, MOVER)
    labs = [seen_as(colour, VISION[kind]) for colour in colours]
    for one, other in itertools.combinations(labs, 2):
        assert np.linalg.norm(one - other) > 12.0
