"""Run a Webots controller in the sandbox, in a world that the judge holds."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

import tdac_envs.webots
from tdac_agent.errors import ControllerFileError, Fault
from tdac_agent.sandbox import (
    ChildUsage,
    ControllerError,
    ControllerFault,
    EnvRefusalError,
    Limits,
    SandboxError,
    start,
)
from tdac_agent.verification import read_source
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.webots.log import Log, way_of
from tdac_envs.webots.requests import RequestError
from tdac_envs.webots.server import RunEnded, StepServer
from tdac_envs.webots.stage import Stage

PACKAGE = Path(tdac_envs.webots.__file__).parent / "controller"
LIMITS = Limits(output_bytes=16 << 20)
GRACE_SECONDS = 1.0
"""Of a controller after the end, as in Webots."""
START_SECONDS = 10.0
LARGEST_FOLDER = 64 << 20
Outcome = Literal[
    "reached", "out of time", "teleport", "quit", "controller ended", "error"
]


@dataclass(frozen=True, slots=True)
class WebotsReport:
    """What a controller did, as the judge saw it; metres, seconds.

    Attributes:
        passed: Whether the goal was reached (where there is one) without a contact,
            and nothing was done that may not be done.
        outcome: How the run ended.
        why_not: Why it has not passed; empty where it has.
        controller: File name.
        world: File name.
        goal: Where the goal is, or None.
        steps: Steps of the world.
        time: Simulated.
        collisions: Steps with a contact.
        first_contact: Step, x and y of the first.
        way: Length of what the robot drove.
        d0: Shortest way to the goal from the start; None without a goal.
        d_min: Shortest way left to the goal at any time.
        d_min_euclidean: The same straight.
        start: x, y, heading.
        end: x, y, heading.
        teleport: What a supervisor did that it may not do.
        error: How the controller failed.
        traceback: The controller's own lines.
        left_out: Nodes that may be solid and were ignored.
        sandbox: Tier.
        output: What the controller printed: the beginning, and the end of much.
    """

    passed: bool
    outcome: Outcome
    why_not: str
    controller: str
    world: str
    goal: tuple[float, float] | None
    steps: int
    time: float
    collisions: int
    first_contact: tuple[int, float, float] | None
    way: float
    d0: float | None
    d_min: float | None
    d_min_euclidean: float | None
    start: tuple[float, float, float]
    end: tuple[float, float, float]
    teleport: str | None
    error: str | None
    traceback: str
    left_out: tuple[str, ...]
    sandbox: str
    output: str


@dataclass(frozen=True, slots=True, eq=False)
class WebotsRun:
    """A run: its report, and what is needed to draw it.

    Attributes:
        report: The report.
        log: The judge's record.
    """

    report: WebotsReport
    log: Log


class _World:
    """A step server that refuses in the words of the sandbox."""

    def __init__(self, server: StepServer) -> None:
        self._server = server

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
            return self._server.step(action)
        except RequestError as error:
            raise EnvRefusalError(str(error)) from error


def run_controller(
    controller: Path,
    stage: Stage,
    env: EPuckEnv,
    *,
    tier: str = "auto",
    limits: Limits = LIMITS,
) -> WebotsRun:
    """Runs a controller's file, with the files beside it, until the end.

    Args:
        controller: The file.
        stage: The world.
        env: Of the stage; see `Stage.make_env`.
        tier: Sandbox tier, or `auto`.
        limits: What the controller may use.

    Raises:
        ControllerFileError: The controller cannot be read.
        Fault: The sandbox failed.
    """
    source = read_source(controller)
    server = StepServer(env, stage)
    seconds = START_SECONDS + env.nominal.horizon * env.nominal.dt
    fault: ControllerFault | None = None
    with tempfile.TemporaryDirectory(prefix="tdac-webots-") as folder:
        _furnish(Path(folder), controller, stage)
        try:
            child = start(Path(folder), source, tier=tier, limits=limits)
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
            arguments = list(stage.arguments())
            child.run_program(_World(server), arguments, seconds, GRACE_SECONDS)
        except RunEnded:
            pass
        except ControllerFault as error:
            fault = error
        except SandboxError as error:
            raise Fault(f"the sandbox failed: {error}") from error
        finally:
            usage = child.close()
    if not server.log.poses:
        server.reset()
    report = _report(controller, stage, server.log, env, fault, usage, child.tier)
    return WebotsRun(report, server.log)


def frames(env: EPuckEnv, log: Log, stride: int) -> Iterator[NDArray[np.uint8]]:
    """Pictures of a run: every so many steps, and the last one.

    Args:
        env: A second one of the same stage, with `render_mode="rgb_array"`.
        log: Of the run.
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


def _furnish(folder: Path, controller: Path, stage: Stage) -> None:
    """Copies the files beside the controller, and the world.

    Raises:
        ControllerFileError: They cannot be read, or are far too large.
    """
    room = LARGEST_FOLDER
    try:
        for entry in sorted(controller.resolve().parent.iterdir()):
            if not entry.is_file():
                continue
            room -= entry.stat().st_size
            if room < 0:
                raise ControllerFileError(
                    f"{entry.parent} holds more than {LARGEST_FOLDER >> 20} MB; put "
                    "the controller in a folder of its own"
                )
            shutil.copyfile(entry, folder / entry.name)
    except OSError as error:
        raise ControllerFileError(
            f"cannot copy the folder of {controller}: {error}"
        ) from error
    (folder / stage.name).write_text(stage.text, encoding="utf-8")


def _report(
    controller: Path,
    stage: Stage,
    log: Log,
    env: EPuckEnv,
    fault: ControllerFault | None,
    usage: ChildUsage,
    tier: str,
) -> WebotsReport:
    # What it does after the end is of no interest.
    error = None if fault is None or log.outcome is not None else fault
    outcome: Outcome = log.outcome or ("controller ended" if error is None else "error")
    why = _why_not(outcome, log, stage, error)
    goal = stage.world.goal if stage.has_goal else None
    return WebotsReport(
        passed=not why,
        outcome=outcome,
        why_not=why,
        controller=controller.name,
        world=stage.name,
        goal=goal,
        steps=log.steps,
        time=log.steps * env.nominal.dt,
        collisions=log.collisions,
        first_contact=log.first_contact,
        way=way_of(log),
        d0=log.path_distances[0] if goal else None,
        d_min=min(log.path_distances) if goal else None,
        d_min_euclidean=min(log.distances) if goal else None,
        start=log.poses[0],
        end=log.poses[-1],
        teleport=log.teleport,
        error=None if error is None else str(error),
        traceback=error.traceback if isinstance(error, ControllerError) else "",
        left_out=stage.left_out,
        sandbox=tier,
        output=_printed(usage),
    )


def _why_not(
    outcome: Outcome, log: Log, stage: Stage, error: ControllerFault | None
) -> str:
    """Why a run has not passed; empty where it has."""
    if log.teleport is not None:
        return f"teleport: {log.teleport}"
    if error is not None:
        return f"the controller failed: {error}"
    reasons = []
    if log.first_contact is not None:
        step, x, y = log.first_contact
        count = f"{log.collisions} steps with a contact"
        reasons.append(f"{count}, the first in step {step} at ({x:.3f}, {y:.3f})")
    if stage.has_goal and outcome != "reached":
        reasons.append(f"the goal was not reached ({outcome})")
    return "; ".join(reasons)


def _printed(usage: ChildUsage) -> str:
    kept = len(usage.output_head.encode()) + len(usage.output_tail.encode())
    gap = "\n[...]\n" if usage.output_bytes > kept else ""
    return usage.output_head + gap + usage.output_tail
