"""Times steps among moving discs, beside a static map and ir-sim.

    python -m benchmarks movers

20 movers of each kind drive between the pillars of a map of 400 x 400 px: with a single
robot, and with each robot of a batch of 1,024 on one thread, which has movers of its
own. Episodes do not end at a contact, so that all cases take the same steps. The floor
is the static map. If ir-sim is installed, its robot drives among 20 discs that walk
about and pass through each other, or avoid each other.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import gymnasium as gym

from benchmarks.env_step import (
    NAME,
    ROUNDS,
    batch_burst,
    pillars,
    random_driving,
    single_burst,
)
from benchmarks.peers import irsim_burst
from benchmarks.timing import Bench, Effort, compared, in_turn

COUNT, ROBOTS, SIDE = 20, 1024, 400
STATIC = "static"
LANES = [56.0 + 96.0 * (k % 4) + 6.0 * (k // 8) for k in range(COUNT)]
ROUTES = [
    {
        "kind": "route",
        "points": [[y, 25.0], [y, SIDE - 25.0]]
        if k % 8 < 4
        else [[25.0, y], [SIDE - 25.0, y]],
        "loop": False,
        "radius": 6.0,
    }
    for k, y in enumerate(LANES)
]
KINDS: dict[str, Any] = {
    STATIC: None,
    f"{COUNT} on routes": ROUTES,
    f"{COUNT} that bounce": [{"kind": "bounce", "count": COUNT, "radius": 6.0}],
    f"a crowd of {COUNT}": [{"kind": "crowd", "count": COUNT, "radius": 6.0}],
}


def benches(effort: Effort) -> list[Bench]:
    """One bench for single environments, and one for batches."""
    rounds = effort.rounds_of(ROUNDS // 3)
    options = {
        "map": pillars(SIDE * SIDE / 1e6),
        "start": (56.0, 56.0),
        "goal": (340.0, 340.0),
        "robot_radius": 8.0,
        "on_collision": "block",
    }
    alone, together = {}, {}
    for kind, movers in KINDS.items():
        env = gym.make(NAME, movers=movers, **options)
        alone[kind] = single_burst(env, random_driving)
        envs = gym.make_vec(
            NAME, ROBOTS, "vector_entry_point", movers=movers, threads=1, **options
        )
        envs.reset(seed=0)
        together[kind] = batch_burst(envs)
    peers = {}
    if find_spec("irsim") is not None:
        peers = {
            f"ir-sim, {COUNT} that walk about": irsim_burst("dash", COUNT),
            f"ir-sim, {COUNT} that avoid each other": irsim_burst("rvo", COUNT),
        }
    return [
        compared(title, in_turn(cases, rounds), STATIC, STATIC)
        for title, cases in (
            ("One robot among movers", {**alone, **peers}),
            (f"{ROBOTS} robots among movers of their own, one thread", together),
        )
    ]
