"""Episodes of an evaluation on disk, one file each, so that none runs twice."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from tdac_agent.storage.files import write_atomic
from tdac_agent.verification.diagnosis.measures import Measured
from tdac_envs.core.intake import read_file

SUFFIX = ".npz"
LARGEST_BYTES = 64 << 20


class _Record(BaseModel):
    model_config = ConfigDict(extra="forbid")

    figures: Measured
    tier: str
    late: bool


@dataclass(frozen=True, slots=True, eq=False)
class KeptEpisode:
    """One finished episode.

    Attributes:
        figures: Its measures.
        tier: Sandbox tier; empty if nothing was started.
        late: Whether the policy timed out.
        poses: Shape (T + 1, 3), float32.
        calls: Durations of the policy's calls, s, shape (T,), float32.
        movers: Moving obstacles in the last steps, oldest first, shape (t, n, 3),
            float32: x, y, radius, px; without any, t or n is 0.
    """

    figures: Measured
    tier: str
    late: bool
    poses: NDArray[np.float32]
    calls: NDArray[np.float32]
    movers: NDArray[np.float32]


def keep_episode(folder: Path, episode: KeptEpisode) -> None:
    """Writes an episode to a file named after its seed, atomically.

    Raises:
        OSError: The folder cannot be written.
    """
    about = _Record(figures=episode.figures, tier=episode.tier, late=episode.late)
    raw = np.frombuffer(about.model_dump_json().encode(), np.uint8)
    content = io.BytesIO()
    np.savez(
        content,
        about=raw,
        poses=episode.poses,
        calls=episode.calls,
        movers=episode.movers,
    )
    write_atomic(_file(folder, episode.figures.seed), content.getvalue(), lasting=False)


def kept_episodes(folder: Path, seeds: Iterable[int]) -> dict[int, KeptEpisode]:
    """The episodes with these seeds in the folder; damaged files are ignored."""
    found = {seed: _read(_file(folder, seed)) for seed in seeds}
    return {seed: episode for seed, episode in found.items() if episode is not None}


def _file(folder: Path, seed: int) -> Path:
    return folder / f"{seed}{SUFFIX}"


def _read(file: Path) -> KeptEpisode | None:
    try:
        raw = read_file(file, LARGEST_BYTES)
        with np.load(io.BytesIO(raw), allow_pickle=False) as arrays:
            about = _Record.model_validate_json(arrays["about"].tobytes())
            poses, calls = arrays["poses"], arrays["calls"]
            movers = arrays["movers"]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
    if file.stem != str(about.figures.seed) or (
        poses.ndim,
        calls.ndim,
        movers.ndim,
    ) != (2, 1, 3):
        return None
    return KeptEpisode(about.figures, about.tier, about.late, poses, calls, movers)
