"""Measures what the judge adds to a controller on a task set.

Two controllers turn on the spot in worlds of `unknown` with a fixed horizon: one that
computes nothing, and one that computes for 1 ms in each step.

The judge's own share is the CPU time of all its processes while the first one drives,
and that of the controller's process, which does nothing but receive and answer. (The
system may count some of the latter for the judge, too; then it is here twice.) It is
solved for a part of each step and a part of each episode, from many short episodes
and from fewer long ones; that of a run of one step is subtracted. The last bench is
wall time: 100 episodes of 300 steps, 1 ms of computation in each; it needs an idle
machine, and the CPU time beside it shows whether that was so.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.timing import Bench, Effort, Row
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_agent.verification.verify_episodes import verify_episodes
from tdac_envs.ladder.set_limits import HorizonSpec
from tdac_envs.ladder.task_sets import TaskSet, load_set

IDLE = "def policy(obs):\n    return 0.3, -0.3\n"
BUSY = """
def policy(obs):
    for number in range({loops}):
        number * number
    return 0.3, -0.3
"""
COMPUTING = 1e-3
"""CPU time of the second controller in a step, s."""
SHORT, LONG = (40, 40), (10, 840)
"""Episodes, and steps of each."""
WHOLE = (100, 300)
READY_SECONDS = 3.0
STEP_LIMIT, EPISODE_LIMIT, WALL_LIMIT = 0.5e-3, 0.1, 60.0


def benches(effort: Effort) -> Sequence[Bench]:
    """The judge's share, and the wall time of 30,000 steps."""
    rounds = effort.rounds_of(3)
    few = 2 if effort.quick else None
    steps, episodes = [], []
    for _ in range(rounds):
        step, episode = _shares(few)
        steps.append(step)
        episodes.append(episode)
    walls, computed = zip(*(_whole(few) for _ in range(rounds)), strict=True)
    return [
        _bench(
            "The judge's own share, CPU time",
            {
                "a step": (steps, STEP_LIMIT, "limit 0.5 ms"),
                "an episode": (episodes, EPISODE_LIMIT, "limit 100 ms; also its world"),
            },
        ),
        _bench(
            "Wall time for 30,000 steps in 100 episodes",
            {
                "1 ms a step": (walls, WALL_LIMIT, "30 s are the controller's"),
                "CPU time ÷ cores": (computed, None, "of all processes"),
            },
        ),
    ]


def _bench(
    title: str, cases: dict[str, tuple[Sequence[float], float | None, str]]
) -> Bench:
    first = next(iter(cases))
    rows = [
        Row(
            case=case,
            seconds=statistics.median(times),
            fastest=min(times),
            slowest=max(times),
            per_floor=1.0,
            speed=1.0,
            low=1.0,
            high=1.0,
            limit=limit,
            note=note,
        )
        for case, (times, limit, note) in cases.items()
    ]
    return Bench(title, first, first, rows)


def _shares(few: int | None) -> tuple[float, float]:
    """Own CPU time of a step and of an episode, s."""
    (many, short), (some, long) = SHORT, LONG
    many, some = few or many, few or some
    with WarmJudge() as judge:
        nothing = _own_cpu(judge, 1, 1)
        # Each is episode + steps * step, for both kinds of episodes.
        each_short = (_own_cpu(judge, many, short) - nothing) / many
        each_long = (_own_cpu(judge, some, long) - nothing) / some
    step = (each_long - each_short) / (long - short)
    return step, each_short - short * step


def _own_cpu(judge: WarmJudge, episodes: int, steps: int) -> float:
    """CPU time of the judge's processes for some episodes, s."""
    _ready()
    before = _ended()
    report = verify_episodes(IDLE, _fixed(steps), episodes, judge=judge)
    assert sum(each.steps for each in report.episodes) == episodes * steps
    _ready()
    return _ended() - before + report.child_cpu_seconds


def _ready() -> None:
    """Waits until the last worker of the judge has ended."""
    time.sleep(READY_SECONDS)


def _ended() -> float:
    """CPU time of all workers of the judge's server that have ended, s."""
    own = Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
    stats = [Path(f"/proc/{pid}/stat").read_text() for pid in own]
    ticks = sum(sum(map(int, s.rpartition(")")[2].split()[13:15])) for s in stats)
    return ticks / os.sysconf("SC_CLK_TCK")


def _whole(few: int | None) -> tuple[float, float]:
    """Wall time of 30,000 steps with 1 ms of computation, and CPU time ÷ cores, s."""
    episodes, steps = WHOLE
    number, busy = few or episodes, BUSY.format(loops=_loops())
    with WarmJudge() as judge:
        verify_episodes(busy, _fixed(1), 1, judge=judge)  # it is warm then
        _ready()
        before, began = _ended(), time.perf_counter()
        report = verify_episodes(busy, _fixed(steps), number, judge=judge)
        wall = time.perf_counter() - began
        _ready()
        computed = _ended() - before + report.child_cpu_seconds
    computed /= len(os.sched_getaffinity(0))
    return wall * episodes / number, computed * episodes / number


def _loops() -> int:
    """How often the second controller's loop runs in `COMPUTING`.

    In the sandbox, the clock of CPU time is too coarse to measure that.
    """
    space: dict[str, Any] = {}
    exec(BUSY.format(loops=100_000), space)
    began = time.process_time()
    for _ in range(20):
        space["policy"](None)
    return round(20 * 100_000 * COMPUTING / (time.process_time() - began))


def _fixed(steps: int) -> TaskSet:
    """The set `unknown`, with a horizon of so many steps."""
    horizon = HorizonSpec(factor=1.0, least=steps, most=steps)
    return TaskSet(load_set("unknown").file.model_copy(update={"horizon": horizon}))


if __name__ == "__main__":
    from benchmarks.timing import show

    for bench in benches(Effort()):
        show(bench)
