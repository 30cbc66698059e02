"""Measures what the judge adds to a controller on a task set.

Two controllers turn on the spot in worlds of `unknown` with a fixed horizon: one that
computes nothing, and one that computes for 1 ms in each step.

The judge's own share is the CPU time of all its processes without the controller's. It
is solved for a part of each step and a part of each episode, from many short episodes
and from fewer long ones; that of a run without episodes is subtracted. CPU time hardly
depends on other load. The last bench is wall time: 100 episodes of 300 steps, 1 ms of
computation in each; it needs an idle machine.
"""

from __future__ import annotations

import resource
import statistics
import time
from collections.abc import Sequence

from benchmarks.timing import Bench, Effort, Row
from tdac_agent.evaluation.set_verify import verify_on_set
from tdac_agent.verification.judge.warm import WarmJudge
from tdac_envs.ladder.set_file import HorizonSpec
from tdac_envs.ladder.task_sets import TaskSet, load_set

IDLE = "def policy(obs):\n    return 0.3, -0.3\n"
BUSY = """
import time
def policy(obs):
    end = time.process_time() + 0.001
    while time.process_time() < end:
        pass
    return 0.3, -0.3
"""
SHORT, LONG = (40, 40), (10, 840)
"""Episodes, and steps of each."""
WHOLE = (100, 300)
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
    walls = [_wall(few) for _ in range(rounds)]
    return [
        _bench(
            "CPU time of the judge, without the controller",
            {
                "a step": (steps, STEP_LIMIT, "limit 0.5 ms"),
                "an episode": (episodes, EPISODE_LIMIT, "limit 100 ms; also its world"),
            },
        ),
        _bench(
            "Wall time for 30,000 steps in 100 episodes",
            {"1 ms a step": (walls, WALL_LIMIT, "the controller's share is 30 s")},
        ),
    ]


def _bench(title: str, cases: dict[str, tuple[Sequence[float], float, str]]) -> Bench:
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
    nothing = _own_cpu(1, 1)
    (many, short), (some, long) = SHORT, LONG
    many, some = few or many, few or some
    # each = episode + steps * step, for both kinds of episodes.
    each_short = (_own_cpu(many, short) - nothing) / many
    each_long = (_own_cpu(some, long) - nothing) / some
    step = (each_long - each_short) / (long - short)
    return step, each_short - short * step


def _own_cpu(episodes: int, steps: int) -> float:
    """CPU time of all processes of a verification without the controller's, s."""
    before = _used()
    with WarmJudge() as judge:
        report = verify_on_set(IDLE, _fixed(steps), "test", episodes, judge=judge)
    assert sum(each.steps for each in report.episodes) == episodes * steps
    return _used() - before - report.child_cpu_seconds


def _used() -> float:
    """CPU time of this process and of all processes that it has waited for, s."""
    own = resource.getrusage(resource.RUSAGE_SELF)
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    return own.ru_utime + own.ru_stime + ended.ru_utime + ended.ru_stime


def _wall(few: int | None) -> float:
    """Wall time for 30,000 steps of a controller that computes for 1 ms in each, s."""
    episodes, steps = WHOLE
    number = few or episodes
    with WarmJudge() as judge:
        verify_on_set(BUSY, _fixed(1), "test", 1, judge=judge)  # it is warm then
        began = time.perf_counter()
        verify_on_set(BUSY, _fixed(steps), "test", number, judge=judge)
        seconds = time.perf_counter() - began
    return seconds * episodes / number


def _fixed(steps: int) -> TaskSet:
    """The set `unknown`, with a horizon of so many steps."""
    horizon = HorizonSpec(factor=1.0, least=steps, most=steps)
    return TaskSet(load_set("unknown").file.model_copy(update={"horizon": horizon}))


if __name__ == "__main__":
    from benchmarks.timing import show

    for bench in benches(Effort()):
        show(bench)
