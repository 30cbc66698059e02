"""Measures what new worlds cost in training: PPO and raw steps, 64 robots.

    python -m benchmarks.set_training [--level L] [--pool N] [--steps N] [--rounds N]

The robots of `tdac train --set` draw from a pool of N training worlds, which are made
and opened before (the time to make them is printed, too). They are compared with the
same robots of TDAC-Map2D-v0 that stay on one world each, robot i on world i modulo the
number of generators: with the maps, starts, goals and horizons of the set. PPO has the
hyperparameters of `tdac train --set`; raw steps are those of the batch, with random
actions that are held for a second. Such episodes soon end with a contact, so this is
nearly the worst case. Cases run in turns, and the best round of each counts.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import torch

from benchmarks.training_speed import Timed
from tdac_agent.training.hyperparameters import model_arguments
from tdac_agent.training.plan import TrainingPlan
from tdac_agent.training.set_plan import make_set_plan
from tdac_envs.drive.vector import DrivenVectorEnv
from tdac_envs.ladder.source import SetSource
from tdac_envs.ladder.task_sets import TaskSet, load_set
from tdac_envs.ladder.vector import LadderVectorEnv
from tdac_envs.learning.sb3 import SB3VecEnv
from tdac_envs.learning.wrapping import wrap_for_rl
from tdac_envs.map2d.vector import Map2DVectorEnv

ROBOTS = 64
HELD = 10
"""Steps for which a random action is held."""


def batch_of(level: str, pool: int, fixed: bool) -> DrivenVectorEnv:
    """The robots of a training, or the same on worlds that stay."""
    if not fixed:
        given = {"level": level, "train_pool": pool}
        batch = LadderVectorEnv(ROBOTS, autoreset_mode="SameStep", **given)
        for index in range(pool):
            batch.setups[0].source.task(index)
        return batch
    tasks = load_set(level)
    each = [_kept(tasks, index) for index in range(len(tasks.file.worlds))]
    return Map2DVectorEnv(ROBOTS, each=each, autoreset_mode="SameStep")


def _kept(tasks: TaskSet, index: int) -> dict[str, Any]:
    """Arguments of TDAC-Map2D-v0 for a training world."""
    task, robot, own = tasks.task("train", index), tasks.file.robot, tasks.file
    return {
        "map": task.terrain.grid.cells,
        "start": tuple(task.start),
        "goal": task.goal,
        "robot_radius": robot.radius,
        "axle_length": robot.axle_length,
        "max_wheel_speed": robot.max_wheel_speed,
        "n_rays": robot.n_rays,
        "field_of_view": robot.field_of_view_deg,
        "range_max": robot.range_max,
        "ray_angles": robot.ray_angles,
        "dt": own.dt,
        "horizon": task.horizon,
        "goal_tolerance": own.goal_tolerance,
        "wheel_slip": own.slip,
        "odometry": "odometry" in own.observed,
        **own.disturbances.model_dump(exclude={"wheel_slip"}),
    }


def warm(level: str, pool: int) -> float:
    """Makes the worlds of a pool that no file has yet; returns the seconds."""
    source, began = SetSource(load_set(level), "train", pool, None), time.perf_counter()
    for index in range(pool):
        source.task(index)
    return time.perf_counter() - began


def raw_speed(batch: DrivenVectorEnv, steps: int) -> float:
    """Steps per second of all robots together, after a warm-up."""
    random = np.random.default_rng(0)
    batch.reset(seed=0)
    rounds = max(steps // ROBOTS // HELD, 1)
    for part in (rounds // 4, rounds):
        began = time.perf_counter()
        for _ in range(part):
            actions = random.uniform(-0.3, 1.0, (ROBOTS, 2)).astype(np.float32)
            for _ in range(HELD):
                batch.step(actions)
    return rounds * HELD * ROBOTS / (time.perf_counter() - began)


def ppo_speed(batch: DrivenVectorEnv, plan: TrainingPlan, steps: int) -> float:
    """Steps per second of a training, end to end, after one rollout."""
    from stable_baselines3 import PPO

    timed = Timed(SB3VecEnv(wrap_for_rl(batch, plan.wrappers)))
    arguments = model_arguments(plan.hyperparameters)
    model = PPO(plan.policy, timed, device="cpu", seed=0, **arguments)
    model.learn(model.n_steps * ROBOTS)
    began = time.perf_counter()
    model.learn(steps)
    return float(model.num_timesteps / (time.perf_counter() - began))


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.set_training")
    parser.add_argument("--level", default="unknown")
    parser.add_argument("--pool", type=int, default=4096)
    parser.add_argument("--steps", type=int, default=65_536)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    torch.set_num_threads(1)
    level, pool, steps = options.level, options.pool, options.steps
    plan = make_set_plan(level, n_envs=ROBOTS)
    print(f"pool of {pool} worlds of {level}: {warm(level, pool):.1f} s", flush=True)
    measures: dict[str, Callable[[Any], float]] = {
        "raw": lambda batch: raw_speed(batch, steps),
        "PPO": lambda batch: ppo_speed(batch, plan, steps),
    }
    best = {(name, fixed): 0.0 for name in measures for fixed in (False, True)}
    for _ in range(options.rounds):
        for name, fixed in list(best):
            batch = batch_of(level, pool, fixed)
            speed = measures[name](batch)
            batch.close()
            best[name, fixed] = max(best[name, fixed], speed)
    for name in measures:
        new, same = best[name, False], best[name, True]
        print(
            f"{name}: {new:>9,.0f} steps/s on worlds of the pool, {same:>9,.0f} on "
            f"fixed ones: {new / same:.2f}"
        )


if __name__ == "__main__":
    main()
