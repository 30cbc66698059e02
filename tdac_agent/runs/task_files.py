"""The files that a run on a task begins with."""

from __future__ import annotations

import shutil
from pathlib import Path

from tdac_agent.runs.ownership import OWN_SUITE
from tdac_agent.storage.files import write_atomic
from tdac_agent.tasks.task import Task, write_workdir
from tdac_envs.core.intake import IMAGE_BYTES, read_file
from tdac_envs.mapping.map_folder import png

PREVIEW_FILE = "preview.png"
"""Picture of the map or world as it was read."""


def write_task(task: Task, folder: Path) -> None:
    """Writes what a run on a task is about: the working files, tests, the original."""
    write_workdir(folder, task)
    write_atomic(folder / PREVIEW_FILE, png(task.setting.preview()))
    if task.suite is not None:
        ignored = shutil.ignore_patterns("__pycache__")
        own = folder / OWN_SUITE
        shutil.copytree(task.suite, own, ignore=ignored, dirs_exist_ok=True)
    original = task.setting.original
    if original is not None:
        write_atomic(folder / original.name, read_file(original.file, IMAGE_BYTES))
