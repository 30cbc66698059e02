"""The controller of a run with the files that it may read, as a ZIP file."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

from tdac_agent.studio.folder import within
from tdac_envs.core.intake import IMAGE_BYTES, read_file

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
            file = within(folder, name)
            if file is not None and file.is_file():
                archive.writestr(name, read_file(file, IMAGE_BYTES))
    return packed.getvalue()
