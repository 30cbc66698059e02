"""The controller of a run with the files that it may read, as a ZIP file."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

FILES = (
    "controller.py",
    "sensors.py",
    "params.json",
    "occupancy.npy",
    "occupancy.png",
    "robot.png",
    "world.wbt",
)
"""What a controller finds in its working folder, as far as the run has it."""


def deployable(folder: Path) -> bytes:
    """The ZIP file of a run folder."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in FILES:
            if (folder / name).is_file():
                archive.write(folder / name, name)
    return packed.getvalue()
