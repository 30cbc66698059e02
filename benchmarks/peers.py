"""Times steps of similar simulators that are installed.

    python -m benchmarks peers

ir-sim: one differential-drive robot with a lidar of 18 beams among three shapes. VMAS:
a batch of its scenario "navigation" with one agent and 18 rays. Ours is timed beside
them with 18 rays, single and in a batch of the same size.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from benchmarks.env_step import (
    NAME,
    ROUNDS,
    Burst,
    batch_burst,
    raced,
    random_driving,
    single_burst,
)
from benchmarks.timing import Bench, Effort

BATCH = 1024
STEPS = 50
IRSIM_WORLD = """
world: {height: 10, width: 10, step_time: 0.05, collision_mode: unobstructed}
robot:
  - kinematics: {name: diff}
    shape: {name: circle, radius: 0.2}
    state: [2, 2, 0]
    goal: [8, 8, 0]
    sensors:
      - {name: lidar2d, range_max: 5, angle_range: 1.92, number: 18}
obstacle:
  - {shape: {name: circle, radius: 1.0}, state: [5, 5, 0]}
  - {shape: {name: rectangle, length: 1.5, width: 1.2}, state: [6, 2, 0.5]}
  - {shape: {name: rectangle, length: 1.0, width: 2.0}, state: [3, 7, 0]}
"""
IRSIM_DISCS = """
  - number: {number}
    distribution: {{name: random, {places}}}
    kinematics: {{name: omni}}
    behavior: {{name: {behavior}, wander: True, {places}}}
    shape: {{name: circle, radius: 0.15}}
"""
IRSIM_PLACES = "range_low: [0.5, 0.5, -3.14], range_high: [9.5, 9.5, 3.14]"


def benches(effort: Effort) -> list[Bench]:
    """One bench."""
    batch = gym.make_vec(NAME, BATCH, "vector_entry_point")
    batch.reset(seed=0)
    bursts = {
        f"{NAME}, random": single_burst(gym.make(NAME), random_driving),
        f"{NAME}, {BATCH} robots": batch_burst(batch),
        **dict(steppers()),
    }
    return [raced("Other simulators", bursts, effort.rounds_of(ROUNDS // 3))]


def steppers() -> Iterator[tuple[str, Burst]]:
    """Name and burst of each installed simulator."""
    if find_spec("irsim") is not None:
        yield "ir-sim, 18 beams", irsim_burst()
    if find_spec("vmas") is not None:
        yield f"VMAS navigation, 18 rays, {BATCH} robots", _vmas()


def irsim_burst(behavior: str = "dash", discs: int = 0) -> Burst:
    """Steps of ir-sim.

    Args:
        behavior: That of moving discs: `dash` to a place, or `rvo`, which avoids
            others.
        discs: Number of moving discs.
    """
    import irsim

    text = IRSIM_WORLD
    if discs:
        text += IRSIM_DISCS.format(number=discs, behavior=behavior, places=IRSIM_PLACES)
    with tempfile.TemporaryDirectory() as name:
        world = Path(name) / "world.yaml"
        world.write_text(text)
        env: Any = irsim.make(str(world), display=False, log_level="ERROR")
    action = np.array([[0.3], [0.2]])

    def burst() -> int:
        for _ in range(STEPS):
            env.step(action)
        return STEPS

    return burst


def _vmas() -> Burst:
    import torch
    from vmas import make_env

    env: Any = make_env(
        "navigation", BATCH, seed=0, n_agents=1, n_lidar_rays=18, lidar_range=0.5
    )
    env.reset()
    actions = [torch.full((BATCH, 2), 0.3)]

    def burst() -> int:
        env.step(actions)
        return BATCH

    return burst
