"""Times the start-up: the command line's help, imports, first steps, a first run.

    python -m benchmarks start_up

Each case is a separate process. The floor is the bare interpreter, the reference one
that imports numpy, as every tool of this kind must. Compiled code is already cached on
disk, as after the first use on a machine; `benchmarks.first_run` measures that first
use.
"""

from __future__ import annotations

import subprocess
import sys
from functools import partial

from benchmarks.first_run import first_runs
from benchmarks.timing import Bench, Effort, compared, in_turn

FLOOR, REFERENCE = "python -c pass", "import numpy"
STEP = (
    "import gymnasium as gym, tdac_envs; env = gym.make('TDAC-Map2D-v0'); "
    "env.reset(seed=0); env.step(env.action_space.sample())"
)
CASES = {
    FLOOR: ["-c", "pass"],
    REFERENCE: ["-c", "import numpy"],
    "tdac --help": ["-m", "tdac_agent", "--help"],
    "import gymnasium": ["-c", "import gymnasium"],
    "import gymnasium, tdac_envs": ["-c", "import gymnasium, tdac_envs"],
    "make, reset and step TDAC-Map2D-v0": ["-c", STEP],
}
LIMITS = {"tdac --help": 0.3}


def benches(effort: Effort) -> list[Bench]:
    """Two benches."""
    calls = {
        name: partial(
            subprocess.run, [sys.executable, *words], check=True, capture_output=True
        )
        for name, words in CASES.items()
    }
    times = in_turn(calls, effort.rounds_of(7))
    bench = compared("Start-up, a process each", times, FLOOR, REFERENCE, LIMITS)
    return [bench, *first_runs(effort)]
