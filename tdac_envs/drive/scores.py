"""Scores of an episode: success weighted by time or by path, in [0, 1]."""

from __future__ import annotations


def time_score(success: bool, steps: int, least_steps: float) -> float:
    """Success weighted by completion time: success * OT / max(T, OT).

    Source: Yokoyama et al., Success Weighted by Completion Time (2021).

    Args:
        success: Whether the goal was reached without contact.
        steps: T, the steps of the episode.
        least_steps: OT, the least number of steps in which any drive reaches the goal.
    """
    return least_steps / max(float(steps), least_steps) if success else 0.0


def path_score(success: bool, driven: float, shortest: float) -> float:
    """SPL, success weighted by path length: success * L / max(driven, L).

    Source: Anderson et al., On Evaluation of Embodied Navigation Agents (2018).

    Args:
        success: Whether the goal was reached without contact.
        driven: Length of the path that was driven.
        shortest: L, length of the shortest path.
    """
    return shortest / max(driven, shortest) if success else 0.0


def barn_score(success: bool, steps: int, least_steps: float) -> float:
    """The metric of the BARN challenge: success * OT' / clip(T, 2 OT', 8 OT').

    It is at most 0.5.

    Args:
        success: Whether the goal was reached without contact.
        steps: T, the steps of the episode.
        least_steps: OT', steps of the whole shortest path at full speed.
    """
    if not success:
        return 0.0
    return least_steps / min(max(float(steps), 2.0 * least_steps), 8.0 * least_steps)
