"""Draws `docs/camera.png`: a camera image of the e-puck in the bundled world `room`.

    python tools/camera_picture.py [FILE]

The left half is the image of the e-puck's own camera, enlarged. The right half is the
same view with six times as many columns and rows.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tdac_envs.webots.cameras import CameraFacts
from tdac_envs.webots.controller.png import png
from tdac_envs.webots.stage import open_stage
from tdac_envs.webots.views import Views
from tdac_envs.worlds.bundled import world_file

FILE = Path(__file__).parent.parent / "docs" / "camera.png"
WORLD, ENLARGED, GAP = "room", 6, 12


def main() -> None:
    """Writes the picture."""
    image = picture()
    height, width, _ = image.shape
    file = Path(sys.argv[1]) if len(sys.argv) > 1 else FILE
    file.write_bytes(png(image.tobytes(), width, height))


def picture() -> NDArray[np.uint8]:
    """The picture: blue, green, red, 255; shape (height, width, 4)."""
    stage = open_stage(world_file(WORLD))
    (own,) = stage.cameras
    large = replace(own, width=ENLARGED * own.width, height=ENLARGED * own.height)
    coarse, fine = _image(own), _image(large)
    coarse = coarse.repeat(ENLARGED, axis=0).repeat(ENLARGED, axis=1)
    white = np.full((len(fine), GAP, 4), 255, np.uint8)
    return np.concatenate([coarse, white, fine], axis=1)


def _image(camera: CameraFacts) -> NDArray[np.uint8]:
    stage = open_stage(world_file(WORLD))
    env = stage.make_env()
    env.reset(seed=0)
    taking = Views((camera,), stage.world, stage.sky, stage.robot, env)
    taking.expose(camera.name)
    data = taking.image(camera.name)
    assert data is not None
    return np.frombuffer(data, np.uint8).reshape(camera.height, camera.width, 4)


if __name__ == "__main__":
    main()
