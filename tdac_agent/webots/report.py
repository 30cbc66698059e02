"""The report on a run of a Webots controller, from the judge's record."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from tdac_agent.sandbox import (
    ChildUsage,
    ControllerError,
    ControllerFault,
    ControllerTimeout,
)
from tdac_agent.webots.project import has_module, is_beside, project_of
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.webots.log import Log, driven_length
from tdac_envs.webots.stage import ControllerWorld

_MISSING = re.compile(r"No module named '([\w.]+)'")
Outcome = Literal[
    "reached", "out of time", "teleport", "quit", "controller ended", "error"
]


@dataclass(frozen=True, slots=True)
class WebotsReport:
    """The report on a run, from the judge's record; lengths in m, times in s.

    Attributes:
        passed: Whether it reached the goal, if any, with no contact, teleport or error.
        outcome: How the run ended.
        why_not: Why the run did not pass; empty if it passed.
        controller: File name of the controller.
        world: File name of the world.
        goal: x and y of the goal, or None.
        steps: Number of simulation steps.
        time: Simulated time.
        collisions: Number of steps with a contact.
        first_contact: Step, x and y of the first contact, or None.
        way: Length of the path that the robot drove.
        d0: Shortest path from the start to the goal; None without a goal.
        d_min: Smallest remaining path to the goal; None without a goal.
        d_min_euclidean: Smallest straight distance to the goal; None without a goal.
        start: x, y and heading at the start.
        end: x, y and heading at the end.
        teleport: Forbidden action of a supervisor, or None.
        error: How the controller failed, or None.
        traceback: The controller's own lines of the traceback.
        left_out: Nodes that may be solid and were ignored.
        notes: What was changed or assumed so that the world could be used.
        sandbox: Sandbox tier.
        output: Output of the controller; of long output, its beginning and end.
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
    notes: tuple[str, ...]
    sandbox: str
    output: str


def report_of(
    controller: Path,
    stage: ControllerWorld,
    log: Log,
    env: EPuckEnv,
    fault: ControllerFault | None,
    usage: ChildUsage,
    tier: str,
) -> WebotsReport:
    """The report on a run that has ended."""
    # An error after the end of the run does not count.
    error = None if fault is None or log.outcome is not None else fault
    outcome: Outcome = log.outcome or ("controller ended" if error is None else "error")
    described = None if error is None else _described(error, controller, log, env)
    why = _why_not(outcome, log, stage, described)
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
        way=driven_length(log),
        d0=log.path_distances[0] if goal else None,
        d_min=min(log.path_distances) if goal else None,
        d_min_euclidean=min(log.distances) if goal else None,
        start=log.poses[0],
        end=log.poses[-1],
        teleport=log.teleport,
        error=described,
        traceback=error.traceback if isinstance(error, ControllerError) else "",
        left_out=stage.left_out,
        notes=stage.notes,
        sandbox=tier,
        output=usage.printed,
    )


_INSTALLED_AS = {
    "cv2": "opencv-python-headless", "PIL": "pillow", "skimage": "scikit-image",
    "skfuzzy": "scikit-fuzzy", "sklearn": "scikit-learn", "yaml": "pyyaml",
}  # fmt: skip


def _described(
    fault: ControllerFault, controller: Path, log: Log, env: EPuckEnv
) -> str:
    """The fault, and what to do about a time limit or a missing package."""
    if isinstance(fault, ControllerTimeout):
        return _too_slow(fault, log.steps, env.nominal.horizon)
    text = " ".join(str(fault).split())  # the text of an exception may have many lines
    if not isinstance(fault, ControllerError):
        return text
    missing = _MISSING.search(fault.text)
    if fault.type_name != "ModuleNotFoundError" or missing is None:
        return text
    name = missing[1].partition(".")[0]
    place = has_module(project_of(controller), name)
    if place:
        return (
            f"{text}; {place} of the project is not on Python's path, nor is it in "
            "Webots: extend sys.path, or put a copy of it beside the controller"
        )
    if is_beside(controller, name):
        return (
            f"{text}; tdac copies only the controller's own folder: put a copy of "
            f"{name}, from the folder above, beside the controller"
        )
    package = _INSTALLED_AS.get(name, name)
    return (
        f"{text}; if it is a package: pip install {package}, in the environment of tdac"
    )


def _too_slow(fault: ControllerTimeout, steps: int, horizon: int) -> str:
    limit = f"{fault.seconds:g} s"
    if not fault.busy:
        return (
            f"it slept or blocked for {limit}, the time limit, and had done {steps} of "
            f"{horizon} steps; remove time.sleep, input and other calls that wait, or "
            "set a longer limit with --seconds"
        )
    if not steps:
        return (
            f"it never called robot.step(), and after {limit} of CPU time the time "
            "limit ended it; call robot.step() in its loop, or set a longer limit with "
            "--seconds"
        )
    return (
        f"it used {limit} of CPU time, the time limit, and had done {steps} of "
        f"{horizon} steps; set a longer limit with --seconds"
    )


def _why_not(
    outcome: Outcome, log: Log, stage: ControllerWorld, error: str | None
) -> str:
    if log.teleport is not None:
        return f"teleport: {log.teleport}"
    if error is not None:
        return f"the controller failed: {error}"
    reasons = []
    if not log.steps and outcome == "controller ended":
        reasons.append("it ended without a call of robot.step()")
    if log.first_contact is not None:
        step, x, y = log.first_contact
        count = f"{log.collisions} steps with a contact"
        reasons.append(f"{count}, the first in step {step} at ({x:.3f}, {y:.3f})")
    if stage.has_goal and outcome != "reached":
        reasons.append(f"the goal was not reached ({outcome})")
    return "; ".join(reasons)
