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
    Child,
    ControllerError,
    ControllerFault,
    EnvRefusalError,
    Limits,
    MachineBusyError,
    SandboxError,
    installed_packages,
    start,
)
from tdac_agent.sandbox.inner.wire import WireError
from tdac_agent.verification.verify import read_source
from tdac_agent.webots.copying import LARGEST
from tdac_agent.webots.project import copier_of, copy_files, copy_folders
from tdac_agent.webots.report import WebotsReport, report_of
from tdac_envs.core.errors import WorldError
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.webots.log import Log
from tdac_envs.webots.requests import RequestError
from tdac_envs.webots.server import RunEnded, StepServer
from tdac_envs.webots.stage import ControllerWorld

PACKAGE = Path(tdac_envs.webots.__file__).parent / "controller"
LIMITS = Limits(output_bytes=16 << 20, scratch_bytes=2 * LARGEST)
GRACE_SECONDS = 1.0
"""Time for a controller after the end of a run, as in Webots."""
START_SECONDS = 10.0
SPARE_SECONDS = 10
"""CPU time for starting and ending, so that the kernel's limit never comes first."""
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

    @property
    def has_begun(self) -> bool:
        """Whether the controller has made a step."""
        return self._server.log.steps > 0

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
        WorldError: The world has too many nodes or devices for a controller.
    """
    source = read_source(controller)
    server = StepServer(env, stage)
    if seconds is None:
        seconds = START_SECONDS + env.nominal.horizon * env.nominal.dt
    if limits is None:
        most = max(LIMITS.cpu_seconds, math.ceil(seconds) + SPARE_SECONDS)
        limits = replace(LIMITS, cpu_seconds=most)
    copier = copier_of(controller)
    with tempfile.TemporaryDirectory(prefix="tdac-webots-") as folder:
        copy_files(Path(folder), controller, copier)
        (Path(folder) / stage.name).write_text(stage.text, encoding="utf-8")
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
            raise Fault(error.fault) from error
        try:
            shutil.copytree(
                PACKAGE,
                child.folder.work / PACKAGE.name,
                ignore=shutil.ignore_patterns("__pycache__"),
            )
            copy_folders(child.folder.work, controller, copier)
            fault = _run(child, _World(server, watch), controller, stage, seconds)
        except MachineBusyError as error:
            steps = f"{server.log.steps} of {env.nominal.horizon} steps"
            raise Fault(f"{error}; it had done {steps}") from error
        except SandboxError as error:
            raise Fault(error.fault) from error
        finally:
            usage = child.close()
    if not server.log.poses:
        server.reset()
    report = report_of(controller, stage, server.log, env, fault, usage, child.tier)
    report = replace(report, notes=(*report.notes, *copier.notes))
    return WebotsRun(report, server.log)


def _run(
    child: Child,
    world: _World,
    controller: Path,
    stage: ControllerWorld,
    seconds: float,
) -> ControllerFault | None:
    """Runs a controller in a prepared child; returns how it failed, if it did.

    Raises:
        SandboxError: The sandbox failed, or the machine was too busy.
        WorldError: The world has too many nodes or devices for a controller.
    """
    name, arguments = _folder_name(controller), list(stage.arguments())
    try:
        child.run_program(world, name, arguments, seconds, GRACE_SECONDS)
    except RunEnded:
        pass
    except ControllerFault as error:
        return error
    except WireError as error:
        if world.has_begun:
            return ControllerFault(f"asked for too much at once: {error}", "the run")
        raise WorldError(
            f"{stage.name}: too large to be described to a controller: {error}; leave "
            "out nodes that the robot does not need"
        ) from error
    return None


def _folder_name(controller: Path) -> str:
    """Name of the controller's folder; another one if it cannot be sent."""
    name = controller.resolve().parent.name
    return name if name.isprintable() and name else "controller"


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
