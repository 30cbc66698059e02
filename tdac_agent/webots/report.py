"""What a Webots controller did, as the judge saw it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from tdac_agent.sandbox import ChildUsage, ControllerError, ControllerFault
from tdac_envs.epuck.env import EPuckEnv
from tdac_envs.webots.log import Log, way_of
from tdac_envs.webots.stage import Stage

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


def report_of(
    controller: Path,
    stage: Stage,
    log: Log,
    env: EPuckEnv,
    fault: ControllerFault | None,
    usage: ChildUsage,
    tier: str,
) -> WebotsReport:
    """The report on a run that has ended."""
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
