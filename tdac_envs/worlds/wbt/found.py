"""What has been found in a file so far."""

from __future__ import annotations

from dataclasses import dataclass, field

from tdac_envs.worlds.wbt.fields import text
from tdac_envs.worlds.wbt.frames import Frame
from tdac_envs.worlds.wbt.tree import Node
from tdac_envs.worlds.world import Arena, EPuck, Obstacle, Unmodelled

MOST_PARTS = 5_000
"""Convex pieces in a world, at most."""
_GOAL = "goal"


@dataclass(slots=True)
class Found:
    """Lists that grow while a file is read."""

    robots: list[EPuck] = field(default_factory=list)
    goals: list[tuple[float, float]] = field(default_factory=list)
    arenas: list[Arena] = field(default_factory=list)
    obstacles: list[Obstacle] = field(default_factory=list)
    unmodelled: list[Unmodelled] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    parts: int = 0

    def obstacle(
        self, node: Node, obstacle: Obstacle, place: int | None = None
    ) -> None:
        """Adds an obstacle, before the one at `place` where that is given.

        Raises:
            WorldError: The world is too large.
        """
        self.parts += len(obstacle.solid) + len(obstacle.visible)
        if self.parts > MOST_PARTS:
            raise node.error(f"the world has more than {MOST_PARTS} convex pieces")
        at = len(self.obstacles) if place is None else place
        self.obstacles.insert(at, obstacle)

    def left_out(self, node: Node, frame: Frame, why: str, solid: bool = True) -> None:
        """Adds a node that is not modelled."""
        x, y, _ = frame.origin.tolist()
        self.unmodelled.append(
            Unmodelled(name_of(node), node.kind, x, y, why, solid, node.line)
        )

    def goal(self, frame: Frame) -> None:
        """Adds a place that is named as the goal."""
        x, y, _ = frame.origin.tolist()
        self.goals.append((x, y))


def name_of(node: Node) -> str:
    """Its name, or else its DEF name, or nothing.

    Raises:
        WorldError: Its name is not a string.
    """
    return text(node, "name", node.define)


def is_goal(node: Node) -> bool:
    """Whether it is named, or defined, as the goal."""
    return _GOAL in (node.define.lower(), name_of(node).lower())
