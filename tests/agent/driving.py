"""Environments on drawn grids, episodes in them, and controllers run in-process."""

import importlib.util
import itertools
import math
import shutil
import sys
from pathlib import Path

import numpy as np

import tdac_envs.controller_kit.sensors
from tdac_agent.episodes.episode import Record
from tdac_agent.episodes.trajectory import Rollout
from tdac_agent.verification.diagnosis.diagnosis import diagnose
from tdac_envs.core.errors import TaskError
from tdac_envs.grid.grid import clearance
from tdac_envs.map2d.env import Map2DEnv
from tdac_envs.map2d.task import widest_connected_radius
from tdac_envs.mapping.params import MapParams


def random_env(random) -> Map2DEnv:
    """A feasible task among random boxes, discs and specks; often a tight one."""
    while True:
        height, width = random.integers(60, 200, 2)
        rows, columns = np.ogrid[:height, :width]
        cells = random.random((height, width)) < random.choice([0, 0, 0.003])
        for _ in range(random.integers(3, 30)):
            x, y = random.integers(width), random.integers(height)
            a, b = random.integers(1, 30, 2)
            if random.random() < 0.5:
                cells[y : y + b, x : x + a] = True
            else:
                cells |= (columns - x) ** 2 + (rows - y) ** 2 < a * a / 4
        clear = clearance(cells)
        places = np.argwhere(clear > 2)
        if len(places) < 10:
            continue
        (j, i), (n, m) = places[random.integers(len(places), size=2)].tolist()
        widest = widest_connected_radius(clear, (i, j), (m, n))
        slack = random.choice([0.0, 0.01, 0.3, 1.0])
        radius = min(random.choice([3.0, 6.0, 8.0, 12.0, 15.0]), widest - slack)
        radius = math.floor(radius) if random.random() < 0.5 else radius
        if radius < 1.5:
            continue
        start = (i, j, float(random.uniform(-3, 3)))
        try:
            return Map2DEnv(cells, start, (m, n), robot_radius=float(radius))
        except TaskError:
            continue


def drive(env, act, start=None, steps=None, name="nominal", held_out=False) -> Rollout:
    """Runs an episode; `act(obs)` gives the wheel speeds."""
    task = env.nominal
    record = Record(env, start or task.start, steps or task.horizon)
    observation, _ = record.reset()
    while record.outcome is None:
        observation = record.step(act(observation))[0]
    return Rollout(
        name=name,
        held_out=held_out,
        outcome=record.outcome,
        trajectory=record.trajectory(),
        goal=task.goal,
        radius=task.body_radius,
        tolerance=task.goal_tolerance,
        contact=record.contact,
        smallest_gap=record.smallest_gap(),
        close_gap=record.close_gap(),
        required_gap=env.required_gap,
    )


def always(left, right):
    """A policy that never does anything else."""
    return lambda obs: (left, right)


def pattern(*actions):
    """Repeats (steps, left, right) blocks."""
    blocks = itertools.cycle([a[1:] for a in actions for _ in range(a[0])])
    return lambda obs: next(blocks)


def judged(env, policy, **options):
    """The episode of a policy, and its diagnosis; `options` are those of `drive`."""
    rollout = drive(env, policy, **options)
    return rollout, diagnose(rollout, env.nominal)


def import_controller(source, env, folder, monkeypatch):
    """The module of a controller, beside the files that it may read."""
    grid, task = env.nominal.terrain.grid, env.nominal
    np.save(folder / "occupancy.npy", grid.cells)
    MapParams(
        source="array",
        source_sha256=grid.sha256(),
        width=grid.width,
        height=grid.height,
        start=task.start[:2],
        heading=task.start.heading,
        goal=task.goal,
        robot=task.robot,
        polarity="given",
        method="given",
    ).save(folder / "params.json")
    shutil.copy(tdac_envs.controller_kit.sensors.__file__, folder / "sensors.py")
    return import_from(folder, source, monkeypatch)


def import_from(folder, source, monkeypatch):
    """The module of a controller in a working folder that is filled."""
    file = folder / "controller.py"
    file.write_text(source)
    # Python would take bytecode of a file of the same length and second for its own.
    Path(importlib.util.cache_from_source(file)).unlink(missing_ok=True)
    monkeypatch.syspath_prepend(folder)
    monkeypatch.delitem(sys.modules, "sensors", raising=False)
    spec = importlib.util.spec_from_file_location("driven", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.delitem(sys.modules, "sensors")
    return module
