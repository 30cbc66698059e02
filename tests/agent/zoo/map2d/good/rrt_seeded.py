# idea: a rapidly exploring random tree from the goal, seeded and shortened
# profile: policy
import math
import random

import numpy as np
import sensors

ROBOT = sensors.load_params()["robot"]
STRIDE = 8.0


def grown(occ, radius):
    """Walls and rim, grown by a disc."""
    reach = math.ceil(radius)
    padded = np.pad(occ, reach, constant_values=True)
    result = np.zeros_like(occ)
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            if math.hypot(dx, dy) <= radius:
                view = padded[reach + dy :, reach + dx :]
                result |= view[: occ.shape[0], : occ.shape[1]]
    return result


class Tree:
    """Grows from the goal; every node knows its parent on the way there."""

    def __init__(self, blocked, goal, seed):
        self.blocked, self.random = blocked, random.Random(seed)
        self.nodes, self.parents = [goal], [0]

    def is_free(self, a, b):
        count = math.ceil(math.dist(a, b)) + 1
        xs = np.rint(np.linspace(a[0], b[0], count)).astype(int)
        ys = np.rint(np.linspace(a[1], b[1], count)).astype(int)
        height, width = self.blocked.shape
        inside = (xs >= 0) & (ys >= 0) & (xs < width) & (ys < height)
        return bool(inside.all()) and not self.blocked[ys, xs].any()

    def nearest(self, point):
        away = np.hypot(*(np.array(self.nodes) - point).T)
        return int(away.argmin())

    def grow(self, target):
        """Adds a node one stride towards a point; returns whether it reached it."""
        k = self.nearest(target)
        far = math.dist(self.nodes[k], target)
        share = min(1.0, STRIDE / max(far, 1e-9))
        x = self.nodes[k][0] + share * (target[0] - self.nodes[k][0])
        y = self.nodes[k][1] + share * (target[1] - self.nodes[k][1])
        if far < 1e-9 or not self.is_free(self.nodes[k], (x, y)):
            return False
        self.nodes.append((x, y))
        self.parents.append(k)
        return share == 1.0

    def grow_until(self, start, most=6000):
        height, width = self.blocked.shape
        for turn in range(most):
            point = (self.random.uniform(0, width), self.random.uniform(0, height))
            if self.grow(start if turn % 10 == 0 else point) and turn % 10 == 0:
                break
        k = self.nearest(start)
        path = [k]
        while path[-1]:
            path.append(self.parents[path[-1]])
        return [self.nodes[k] for k in path]


def shortened(tree, path, seed):
    """Tries random short cuts."""
    chance = random.Random(seed)
    for _ in range(150):
        if len(path) < 3:
            break
        i, j = sorted(chance.sample(range(len(path)), 2))
        if j > i + 1 and tree.is_free(path[i], path[j]):
            path = path[: i + 1] + path[j:]
    return path


PATH = []


def reset(obs):
    blocked = grown(sensors.load_occupancy(), ROBOT["radius"] + 3)
    x, y, _ = map(float, obs["pose"])
    goal = (float(obs["goal"][0]), float(obs["goal"][1]))
    tree = Tree(blocked, goal, seed=5)
    PATH[:] = shortened(tree, tree.grow_until((x, y)), seed=6)


def policy(obs):
    if not PATH:
        reset(obs)
    x, y, heading = map(float, obs["pose"])
    while len(PATH) > 1 and math.dist(PATH[0], (x, y)) < 2.5:
        PATH.pop(0)
    error = math.remainder(
        math.atan2(PATH[0][1] - y, PATH[0][0] - x) - heading, math.tau
    )
    if abs(error) > 0.12:
        turn = math.copysign(min(abs(error), 0.5), error)
        return turn, -turn
    speed = min(0.7, 0.1 + math.dist(PATH[0], (x, y)) / 12)
    return speed + 0.5 * error, speed - 0.5 * error
