"""The speed of a video: how much faster than real time, and how many frames it has."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

LONGEST_SECONDS = 60.0
"""Longest video in real time, s; the video of a longer episode plays faster."""
MOST_FPS, GIF_FPS = 25.0, 10.0


@dataclass(frozen=True, slots=True)
class Film:
    """How a video shows an episode.

    Attributes:
        speed: Simulated time / playing time.
        stride: Steps between two frames.
        fps: Frames per second of playing time.
        seconds: Playing time, s.
    """

    speed: float
    stride: int
    fps: float
    seconds: float

    def __str__(self) -> str:
        """The speed in words, as in `in real time, 41 s`."""
        times = f"at {self.speed:g} times real time"
        speed = "in real time" if self.speed == 1.0 else times
        return f"{speed}, {self.seconds:.0f} s"


def film_of(
    steps: int, dt: float, speed: float | None = None, video: Path | None = None
) -> Film:
    """Plans a video of an episode.

    Args:
        steps: Steps of the episode.
        dt: Time per step, s.
        speed: Simulated time / playing time; by default 1, or the least whole number
            with which the video lasts at most `LONGEST_SECONDS`.
        video: File of the video; a GIF has fewer frames, so that it stays small.
    """
    is_gif = video is not None and video.suffix.lower() == ".gif"
    most = GIF_FPS if is_gif else MOST_FPS
    simulated = steps * dt
    if speed is None:
        speed = float(max(1, math.ceil(round(simulated / LONGEST_SECONDS, 6))))
    stride = max(1, math.ceil(round(speed / (dt * most), 6)))
    return Film(speed, stride, speed / (dt * stride), simulated / speed)
