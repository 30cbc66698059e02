"""Prints the hashes of the bundled task sets, for `tdac_envs/ladder/frozen.py`.

    python -m tools.frozen           # the tables CODE and FROZEN
    python -m tools.frozen --drive   # a hash of some episodes of each set

Run the second one before and after a change of code, on one machine: equal hashes show
that the change moves no number of these episodes.
"""

from __future__ import annotations

import hashlib
import sys

import gymnasium as gym
import numpy as np

import tdac_envs
from tdac_envs.core.dynamics import code_sha256
from tdac_envs.ladder.frozen import ON_MAPS_OF_SETS, ON_PLATES
from tdac_envs.ladder.set_file import shipped_names

WORLDS, STEPS = 4, 400


def main() -> None:
    """Prints the tables, or the hashes of episodes."""
    if "--drive" not in sys.argv:
        print(f'    ON_MAPS_OF_SETS: "{code_sha256(*ON_MAPS_OF_SETS)}",')
        print(f'    ON_PLATES: "{code_sha256(*ON_PLATES)}",')
    for name in shipped_names():
        if "--drive" in sys.argv:
            print(f"{name}: {driven(name)}", flush=True)
            continue
        own = tdac_envs.load_set(name)
        print(f'    "{name}": Frozen(')
        print(f'        "{own.sha256}",\n        "{own.dynamics}",\n    ),', flush=True)


def driven(name: str) -> str:
    """Hash of all that a robot observes that drives at random on some worlds."""
    found = hashlib.sha256()
    split = "test" if name.startswith("barn") else "dev"
    env = gym.make("tdac_envs:TDAC-Ladder-v0", level=name, split=split)
    for index in range(WORLDS):
        random, action = np.random.default_rng(index), np.ones(2)
        seen, _ = env.reset(seed=index, options={"index": index})
        for _ in range(STEPS):
            found.update(b"".join(seen[key].tobytes() for key in sorted(seen)))
            action = np.clip(action + random.normal(0.0, 0.2, 2), -1.0, 1.0)
            seen, _, ended, late, _ = env.step(action.astype(np.float32))
            if ended or late:
                break
    return found.hexdigest()


if __name__ == "__main__":
    main()
