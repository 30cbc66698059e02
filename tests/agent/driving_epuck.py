"""Worlds for an e-puck, drawn or bundled, as tasks, and controllers in them."""

import math
from pathlib import Path

import numpy as np
from driving import drive, import_from

from tdac_agent import load_task
from tdac_agent.environments.epuck.entry import EPUCK
from tdac_agent.tasks.task import Task, write_workdir
from tdac_agent.tasks.task_file import TaskFile
from tdac_envs import bundled_worlds, write_world
from tdac_envs.core.errors import TdacError
from tdac_envs.worlds.footprint import Disc, Polygon, Rectangle
from tdac_envs.worlds.world import Arena, EPuck, Obstacle, Part, World

PAPER_WORLD = (
    Path(__file__).parents[3] / "shared" / "data" / "worlds" / "00_paper_empty.wbt"
)
WORLDS = (*bundled_worlds(), "paper")


def world_task(name: str) -> Task | None:
    """The task of a bundled world, or of the paper's, where that file is there."""
    if name != "paper":
        return load_task(TaskFile(env=EPUCK.id, world=name))
    if not PAPER_WORLD.is_file():
        return None
    return load_task(TaskFile(env=EPUCK.id, world=str(PAPER_WORLD)))


def random_world(random) -> World:
    """An e-puck among boxes, walls, barrels and rocks, some too high or too low."""
    yaw, (x, y) = random.uniform(-3.0, 3.0), random.uniform(-2.0, 2.0, 2)
    floor = Rectangle(x, y, yaw, 1.6, 1.0)
    arena = [
        Arena(Disc(x, y, 0.7), 0.01, 0.1),
        Arena(floor, 0.01, 0.1),
        Arena(floor),
    ][random.integers(3)]

    def place():
        u, v = random.uniform((-0.6, -0.4), (0.6, 0.4))
        cos, sin = math.cos(yaw), math.sin(yaw)
        return x + cos * u - sin * v, y + sin * u + cos * v

    things = []
    for number in range(random.integers(4, 25)):
        at, z = place(), random.choice([0.0, 0.0, 0.0, 0.1, -0.2])
        part = Part(random_shape(random, *at), z, z + 0.1)
        mass = 0.1 if z >= 0.0 and random.random() < 0.2 else None
        things.append(
            Obstacle(f"thing {number}", "Solid", *at, (part,), (part,), mass=mass)
        )
    robot = EPuck("e-puck", *place(), random.uniform(-3.0, 3.0))
    return World((robot,), place(), (arena,), tuple(things))


def random_shape(random, x, y):
    """A disc, a box, a wall or a rock."""
    kind = random.integers(4)
    if kind == 0:
        return Disc(x, y, random.uniform(0.02, 0.1))
    if kind == 1:
        sides = random.uniform(0.03, 0.3, 2)
        return Rectangle(x, y, random.uniform(-3.0, 3.0), *sides)
    if kind == 2:
        length = random.uniform(0.2, 0.6)
        return Rectangle(x, y, random.uniform(-3.0, 3.0), length, 0.02)
    angles = 0.7 * np.arange(9) + random.uniform(0.0, 0.6, 9)
    corners = random.uniform(0.05, 0.15) * np.exp(1j * angles)
    return Polygon.around([(x + p.real, y + p.imag) for p in corners])


def random_task(random, folder) -> Task:
    """A feasible task in such a world."""
    while True:
        file = folder / "drawn.wbt"
        file.write_text(write_world(random_world(random)))
        try:
            return load_task(TaskFile(env=EPUCK.id, world=str(file)))
        except TdacError:
            continue


def import_into(task, source, folder, monkeypatch):
    """The module of a controller, beside the files that it may read."""
    write_workdir(folder, task)
    return import_from(folder, source, monkeypatch)


def episode(module, env, start):
    """One episode, begun as the judge begins it."""
    begun = []

    def act(observation):
        if not begun:
            module.reset(observation)
            begun.append(True)
        return module.policy(observation)

    return drive(env, act, start)
