"""What a step of each environment costs, next to CartPole-v1 and to doing nothing.

    python -m benchmarks steps

The tables of `benchmarks.env_step`, and one with the e-puck and, where they are
installed, other simulators. Floor: an environment that does nothing, so that
Gymnasium's wrappers are all that it costs. Batches count one step for each robot.
"""

from __future__ import annotations

import gymnasium as gym
from gymnasium.envs.registration import EnvSpec

from benchmarks import race
from benchmarks.env_step import (
    BENCHES,
    REFERENCE,
    DoNothing,
    random_driving,
    reference,
    single_burst,
)
from benchmarks.peers import steppers
from benchmarks.timing import Bench, Row, compared, row_of

FLOOR = "nothing"


def benches(quick: bool = False) -> list[Bench]:
    """The tables of `env_step`, then the others."""
    rounds = 4 if quick else 30
    found = [
        Bench(title, FLOOR, REFERENCE, [_row(row) for row in rows(rounds)])
        for title, rows in list(BENCHES.items())[: 1 if quick else None]
    ]
    return [*found, _others(rounds)]


def _row(row: race.Row) -> Row:
    """A row of a race; its ratio is of times here, and of speeds there."""
    if row.ratio is None or not row.low or not row.high:
        return Row(row.name, 0.0, 0.0, 0.0, note=f"{row.value:.3g} {row.unit}")
    seconds = 1e-6 * row.value
    spread = f"{row.ratio:.2f} x as fast, quartiles {row.low:.2f} to {row.high:.2f}"
    return Row(
        row.name, seconds, seconds, seconds, per_reference=1 / row.ratio, note=spread
    )


def _others(rounds: int) -> Bench:
    nothing = gym.make(EnvSpec("Floor-v0", entry_point=DoNothing))
    bursts = {
        FLOOR: single_burst(nothing, random_driving),
        REFERENCE: reference(),
        "e-puck, random": single_burst(gym.make("TDAC-EPuck-v0"), random_driving),
        **dict(steppers()),
    }
    taken = race.race(bursts, rounds)
    rows = [row_of(name, seconds) for name, seconds in taken.items()]
    return compared("The e-puck, and other simulators", rows, FLOOR, REFERENCE)
