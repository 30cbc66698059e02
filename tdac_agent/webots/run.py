"""Runs a Webots controller in the sandbox, in a world that the judge simulates."""

from __future__ import annotations

import math
import shutil
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import tdac_envs.webots
from tdac_agent.errors import ControllerFileError, Fault
from tdac_agent.sandbox import (
    ControllerError,
    ControllerFault,
    EnvRefusalError,
    Limits,
    MachineBusyError,
    SandboxError,
    installed_packages,
    start,
)
from tdac_agent.verification.verify import read_source
from tdac_agent.webots.report import WebotsReport, report_of
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.webots.log import Log
from tdac_envs.webots.requests import RequestError
from tdac_envs.webots.server import RunEnded, StepServer
from tdac_envs.webots.stage import ControllerWorld

PACKAGE = Path(tdac_envs.webots.__file__).parent / "controller"
LIMITS = Limits(output_bytes=16 << 20)
GRACE_SECONDS = 1.0
"""Time for a controller after the end of a run, as in Webots."""
START_SECONDS = 10.0
SPARE_SECONDS = 10
"""CPU time for starting and ending, so that the kernel's limit never comes first."""
LARGEST_FOLDER = 64 << 20
_NOT_COPIED = (PACKAGE.name, "__pycache__", "build")
Watch = Callable[[int], None]


@dataclass(frozen=True, slots=True, eq=False)
class WebotsRun:
    """The report on a run, and the judge's record for drawing it."""

    report: WebotsReport
    log: Log


class _World:
    """A step server that refuses requests with an error of the sandbox."""

    def __init__(self, server: StepServer, watch: Watch | None) -> None:
        self._server, self._watch = server, watch

    @property
    def is_over(self) -> bool:
        return self._server.is_over

    def reset(self) -> dict[str, Any]:
        try:
            return self._server.reset()
        except RequestError as error:
            raise EnvRefusalError(str(error)) from error

    def step(self, action: Any) -> dict[str, Any]:
        try:
            answer = self._server.step(action)
        except RequestError as error:
            raise EnvRefusalError(str(error)) from error
        if self._watch is not None:
            self._watch(self._server.log.steps)
        return answer


def run_controller(
    controller: Path,
    stage: ControllerWorld,
    env: EPuckEnv,
    *,
    tier: str = "auto",
    limits: Limits | None = None,
    seconds: float | None = None,
    watch: Watch | None = None,
) -> WebotsRun:
    """Runs a controller with all files of its folder until the run ends.

    Args:
        controller: The file.
        stage: The world.
        env: Environment of the stage; see `ControllerWorld.make_env`.
        tier: Sandbox tier, or `auto`.
        limits: Resource limits of the controller; by default `LIMITS`, with as much
            CPU time as `seconds` allows.
        seconds: CPU time of the controller, and time that it may sleep; by default
            `START_SECONDS` and the simulated time of all steps.
        watch: Called with the number of steps so far.

    Raises:
        ControllerFileError: The controller cannot be read.
        Fault: The sandbox failed, or the machine was too busy.
    """
    source = read_source(controller)
    server = StepServer(env, stage)
    if seconds is None:
        seconds = START_SECONDS + env.nominal.horizon * env.nominal.dt
    if limits is None:
        most = max(LIMITS.cpu_seconds, math.ceil(seconds) + SPARE_SECONDS)
        limits = replace(LIMITS, cpu_seconds=most)
    fault: ControllerFault | None = None
    left_out: tuple[str, ...] = ()
    with tempfile.TemporaryDirectory(prefix="tdac-webots-") as folder:
        _copy_files(Path(folder), controller, stage)
        try:
            child = start(
                Path(folder),
                source,
                tier=tier,
                limits=limits,
                installed=installed_packages(),
            )
        except ControllerError as error:
            raise ControllerFileError(f"{controller}: {error}") from error
        except SandboxError as error:
            raise Fault(f"the sandbox failed: {error}") from error
        try:
            shutil.copytree(
                PACKAGE,
                child.folder.work / PACKAGE.name,
                ignore=shutil.ignore_patterns("__pycache__"),
            )
            left_out = _copy_folders(child.folder.work, controller)
            arguments = list(stage.arguments())
            child.run_program(_World(server, watch), arguments, seconds, GRACE_SECONDS)
        except RunEnded:
            pass
        except ControllerFault as error:
            fault = error
        except MachineBusyError as error:
            steps = f"{server.log.steps} of {env.nominal.horizon} steps"
            raise Fault(f"{error}; it had done {steps}") from error
        except SandboxError as error:
            raise Fault(f"the sandbox failed: {error}") from error
        finally:
            usage = child.close()
    if not server.log.poses:
        server.reset()
    report = report_of(controller, stage, server.log, env, fault, usage, child.tier)
    if left_out:
        report = replace(report, notes=(*report.notes, *left_out))
    return WebotsRun(report, server.log)


def frames(env: EPuckEnv, log: Log, stride: int) -> Iterator[NDArray[np.uint8]]:
    """Yields pictures of a run: one every `stride` steps, and the last one.

    Args:
        env: Another environment of the stage, with `render_mode="rgb_array"`.
        log: Record of the run.
        stride: Steps between two pictures.
    """
    env.reset(seed=0)
    for step, action in enumerate(log.actions):
        if step % stride == 0:
            yield _picture(env)
        env.step(action)
    yield _picture(env)


def _picture(env: EPuckEnv) -> NDArray[np.uint8]:
    frame = env.render()
    assert frame is not None
    return frame


def _copy_files(folder: Path, controller: Path, stage: ControllerWorld) -> None:
    """Copies all files of the controller's folder, and the world.

    Raises:
        ControllerFileError: The files cannot be read, or are too large.
    """
    room = LARGEST_FOLDER
    try:
        for entry in sorted(controller.resolve().parent.iterdir()):
            if not entry.is_file():
                continue
            room -= entry.stat().st_size
            if room < 0:
                raise ControllerFileError(
                    f"{entry.parent} has more than {LARGEST_FOLDER >> 20} MB; put "
                    "the controller in a folder of its own"
                )
            shutil.copyfile(entry, folder / entry.name)
    except OSError as error:
        raise ControllerFileError(
            f"cannot copy the folder of {controller}: {error}"
        ) from error
    (folder / stage.name).write_text(stage.text, encoding="utf-8")


def _copy_folders(work: Path, controller: Path) -> tuple[str, ...]:
    """Copies the subfolders beside the controller; returns notes on those left out."""
    room, notes = LARGEST_FOLDER, list[str]()
    for folder in sorted(controller.resolve().parent.iterdir()):
        if not folder.is_dir() or folder.name in _NOT_COPIED or folder.name[0] == ".":
            continue
        try:
            size = sum(part.stat().st_size for part in folder.rglob("*"))
            if size > room:
                notes.append(
                    f"the folder {folder.name} beside the controller is not copied: "
                    f"more than {LARGEST_FOLDER >> 20} MB"
                )
                continue
            room -= size
            shutil.copytree(
                folder,
                work / folder.name,
                ignore=shutil.ignore_patterns("__pycache__", ".*"),
                ignore_dangling_symlinks=True,
            )
        except (OSError, shutil.Error) as error:
            notes.append(f"the folder {folder.name} cannot be copied: {error}")
    return tuple(notes)
