"""Collects the content of a file while it is read."""

from __future__ import annotations

from dataclasses import dataclass, field

from tdac_envs.worlds.materials import MATERIAL
from tdac_envs.worlds.wbt.fields import text
from tdac_envs.worlds.wbt.frames import NodeFrame
from tdac_envs.worlds.wbt.tree import WbtNode
from tdac_envs.worlds.world import Arena, EPuck, Obstacle, Unmodelled

MOST_PARTS = 20_000
"""Maximum number of convex pieces in a world."""
_GOAL = "goal"


@dataclass(slots=True)
class WorldContent:
    """The content of a file found so far."""

    robots: list[EPuck] = field(default_factory=list)
    goals: list[tuple[float, float]] = field(default_factory=list)
    arenas: list[Arena] = field(default_factory=list)
    obstacles: list[Obstacle] = field(default_factory=list)
    unmodelled: list[Unmodelled] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    parts: int = 0

    def obstacle(
        self, node: WbtNode, obstacle: Obstacle, place: int | None = None
    ) -> None:
        """Inserts an obstacle at index `place`, by default at the end.

        Raises:
            WorldError: The world has more than `MOST_PARTS` pieces.
        """
        self.parts += len(obstacle.solid) + len(obstacle.visible)
        if self.parts > MOST_PARTS:
            raise node.error(f"the world has more than {MOST_PARTS} convex pieces")
        at = len(self.obstacles) if place is None else place
        self.obstacles.insert(at, obstacle)

    def left_out(
        self, node: WbtNode, frame: NodeFrame, why: str, solid: bool = True
    ) -> None:
        """Adds a node that is not modelled, with the reason."""
        x, y, _ = frame.origin.tolist()
        self.unmodelled.append(
            Unmodelled(name_of(node), node.kind, x, y, why, solid, node.line)
        )

    def goal(self, frame: NodeFrame) -> None:
        """Adds the position of a node that is named as the goal."""
        x, y, _ = frame.origin.tolist()
        self.goals.append((x, y))


def name_of(node: WbtNode) -> str:
    """The node's `name` field, else its DEF name, else an empty string.

    Raises:
        WorldError: The `name` field is not a string.
    """
    return text(node, "name", node.define)


def material_of(node: WbtNode) -> str:
    """The node's contact material.

    Raises:
        WorldError: The `contactMaterial` field is not a string.
    """
    return text(node, "contactMaterial", MATERIAL)


def is_goal(node: WbtNode) -> bool:
    """Whether the node's name or DEF name is "goal", in any case."""
    return _GOAL in (node.define.lower(), name_of(node).lower())
