"""Provenance of reports: hashes, limits and versions."""

from __future__ import annotations

import functools
import importlib.metadata
import platform
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tdac_agent.sandbox import Limits
from tdac_agent.storage.hashes import sha256_of
from tdac_agent.tasks.task import Task

VERSIONED = ("tdac", "gymnasium", "numpy", "numba", "pytest", "opencv-python-headless")


def origin(
    task: Task, source: bytes, workdir: Path, tier: str, limits: Limits
) -> dict[str, Any]:
    """Returns the provenance fields that all kinds of reports share.

    Args:
        task: The controller's task.
        source: Bytes of `controller.py`.
        workdir: Working folder of the controller.
        tier: Sandbox tier that the controller ran in.
        limits: Limits of its processes.
    """
    weak = "this sandbox tier cannot withhold the network and other files"
    return {
        "task": task.name,
        "task_sha256": task.sha256(),
        "dynamics": task.dynamics(),
        "unit": task.setting.units.place,
        "left_out": task.setting.left_out,
        "map_sha256": task.setting.world_sha256(),
        "params_sha256": sha256_of(task.params.model_dump_json().encode()),
        # raw read: our temporary folder
        "sensors_sha256": sha256_of((workdir / "sensors.py").read_bytes()),
        "controller_sha256": sha256_of(source),
        "sandbox": tier,
        "limits": asdict(limits),
        "warnings": (*((weak,) if tier == "rlimits" else ()), *task.params.notes),
        "versions": dict(versions()),
    }


@functools.cache
def versions() -> dict[str, str]:
    """Returns the versions of Python and of the packages a verdict may depend on."""
    packages = {name: importlib.metadata.version(name) for name in VERSIONED}
    return {"python": platform.python_version(), **packages}
