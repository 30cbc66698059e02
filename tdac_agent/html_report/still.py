"""A picture of an e-puck's run in three dimensions, rendered by MuJoCo."""

from __future__ import annotations

import io
import threading
from typing import Any

from PIL import Image

from tdac_agent.html_report.animation import recorded_episodes
from tdac_agent.html_report.names import candidate_name
from tdac_agent.html_report.scene import data_address
from tdac_agent.runs.history import RunHistory
from tdac_envs.core.errors import TaskError
from tdac_envs.epuck.task import EPuckTask

MOST_STILLS = 6
"""Runs of a page that have a picture; each takes about half a second."""
_QUALITY = 85


def still_of(history: RunHistory) -> dict[str, Any] | None:
    """The robot of the last candidate where it came nearest to an obstacle.

    None for a run on a map, without MuJoCo or OpenGL, and in a thread: a context of
    OpenGL belongs to one thread at a time.

    Returns:
        Address of the image, its size (px), and what it shows.
    """
    task = None if history.task is None else history.task.nominal
    in_main = threading.current_thread() is threading.main_thread()
    if not isinstance(task, EPuckTask) or not in_main:
        return None
    kept = [(one, list(recorded_episodes(one))) for one in history.tried]
    driven = [(one, episodes[0]) for one, episodes in kept if episodes]
    if not driven:
        return None
    one, (episode, trajectory) = driven[-1]
    gap = episode.smallest_gap
    step = trajectory.steps if gap is None or gap.step is None else gap.step
    try:
        from tdac_envs.epuck.solid_picture import SolidPicture

        frame = SolidPicture(task).frame(
            trajectory.poses[step].tolist(), trajectory.poses[:step, :2].tolist()
        )
    except TaskError:  # the extra is not there, or nothing can be rendered
        return None
    stream = io.BytesIO()
    Image.fromarray(frame).save(stream, "JPEG", quality=_QUALITY)
    return {
        "address": data_address(stream.getvalue(), "image/jpeg"),
        "height": frame.shape[0],
        "width": frame.shape[1],
        "text": f"{candidate_name(one.k, one.j)}, {episode.name}, step {step}"
        + (": its smallest gap" if gap is not None else ""),
    }
