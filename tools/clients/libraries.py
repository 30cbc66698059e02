"""The libraries, their requirements, and the program that trains with each."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
TRAININGS = Path(__file__).parent / "trainings"
EXAMPLES = ROOT / "examples"


@dataclass(frozen=True)
class Library:
    """One library.

    Attributes:
        trained: What the program trains, for the table.
        program: The program and its arguments.
        needs: Requirements that pip installs in addition to tdac.
        shown: Distributions whose versions the table shows.
        torch: Whether the library needs torch.
        missing: Why it cannot run; empty if it can.
    """

    trained: str
    program: tuple[str, ...]
    needs: tuple[str, ...]
    shown: tuple[str, ...]
    torch: bool = True
    missing: str = ""


def _own(name: str) -> tuple[str, ...]:
    return (str(TRAININGS / f"{name}.py"),)


_CLEANRL = os.environ.get("CLEANRL", "")

LIBRARIES = {
    "sb3": Library(
        "PPO on a batch, HER on `GoalView`, a video",
        _own("train_sb3"),
        ("stable-baselines3>=2.7", "moviepy>=2.2"),
        ("stable-baselines3",),
    ),
    "sb3-contrib": Library(
        "TRPO and RecurrentPPO on a batch, TQC",
        _own("train_sb3_contrib"),
        ("sb3-contrib>=2.7",),
        ("sb3-contrib",),
    ),
    "cleanrl": Library(
        "PPO, `ppo_continuous_action.py` unmodified",
        (
            str(EXAMPLES / "cleanrl_maze.py"),
            _CLEANRL,
            *("--total-timesteps", "8192"),
        ),
        ("tyro", "tensorboard"),
        (),
        missing="" if _CLEANRL else "CLEANRL=PATH is not set",
    ),
    "torchrl": Library(
        "PPO loss on collected steps, `check_env_specs`",
        _own("train_torchrl"),
        ("torchrl",),
        ("torchrl",),
    ),
    "tianshou": Library(
        "PPO on a `DummyVectorEnv`",
        _own("train_tianshou"),
        ("tianshou",),
        ("tianshou",),
    ),
    "skrl": Library(
        "PPO on a batch, recognised by `wrap_env`",
        _own("train_skrl"),
        ("skrl",),
        ("skrl",),
    ),
    "rllib": Library(
        "PPO on the new API stack",
        (str(EXAMPLES / "rllib_maze.py"), "--steps", "4096"),
        ("ray[rllib]",),
        ("ray",),
    ),
    "minari": Library(
        "a data set of 3 episodes, recorded and read",
        _own("record_minari"),
        ("minari[create,hdf5]",),
        ("minari",),
        torch=False,
    ),
}
