# idea: Dijkstra's field from the goal, rolled down with a lookahead
# profile: paper
"""A cost field over the pixels, dearer near walls; the robot rolls down its slope."""

import heapq
import math

import numpy as np
import sensors

MAP_IMG = "occupancy.npy"
PARAMS_JSON = "params.json"
ROBOT_IMG = "robot.png"
_PARAMS = sensors.load_params(PARAMS_JSON)
_ROBOT = _PARAMS["robot"]
AXLE_LENGTH_PX = _ROBOT["axle_length"]
SENSOR_RANGE_PX = _ROBOT["range_max"]
SENSOR_FOV_DEG = _ROBOT["field_of_view_deg"]
N_RAYS = _ROBOT["n_rays"]
LOOKAHEAD = 12
STOP_DIST = 0.0
SLOW_DIST = 0.0


class OccMap2D:
    def __init__(self, occ):
        self.cells = np.asarray(occ, bool).tolist()
        self.height, self.width = len(self.cells), len(self.cells[0])

    def is_occupied(self, x, y):
        inside = 0 <= x < self.width and 0 <= y < self.height
        return self.cells[int(y)][int(x)] if inside else True

    def neighbours(self, x, y, step=1):
        """Pixels reached by one straight or diagonal step, with its length."""
        for dx in (-1, 0, 1):
            for dy in (-1, 0, 1):
                if (dx or dy) and self.is_way(x, y, dx, dy, step):
                    yield x + dx * step, y + dy * step, math.hypot(dx, dy) * step

    def is_way(self, x, y, dx, dy, step):
        return all(
            not self.is_occupied(x + k * dx, y + k * dy)
            and not (dx and dy and self.is_occupied(x + k * dx, y + (k - 1) * dy))
            and not (dx and dy and self.is_occupied(x + (k - 1) * dx, y + k * dy))
            for k in range(1, step + 1)
        )


def nearest_free(map2d, x, y, max_rad):
    x, y, reach = round(x), round(y), math.ceil(max_rad)
    found = [
        (math.hypot(i - x, j - y), i, j)
        for j in range(y - reach, y + reach + 1)
        for i in range(x - reach, x + reach + 1)
        if not map2d.is_occupied(i, j)
    ]
    distance, i, j = min(found, default=(math.inf, x, y))
    if distance > max_rad:
        raise ValueError(f"({x}, {y}): no free pixel within {max_rad} px")
    return i, j


def spread(map2d, source, step=1, price=None, until=None):
    """Cost from every pixel to `source`, as a dict."""
    field, queue, done = {source: 0.0}, [(0.0, source)], set()
    while queue:
        cost, here = heapq.heappop(queue)
        if here in done:
            continue
        done.add(here)
        if here == until:
            break
        factor = 1.0 if price is None else price[here[1]][here[0]]
        for i, j, length in map2d.neighbours(*here, step):
            after = cost + length * factor
            if after < field.get((i, j), math.inf):
                field[i, j] = after
                heapq.heappush(queue, (after, (i, j)))
    return field


def plan_path(map2d, start, goal, cell):
    start, goal = tuple(map(int, start)), tuple(map(int, goal))
    if map2d.is_occupied(*start) or map2d.is_occupied(*goal):
        return []
    field = spread(map2d, goal, cell, until=start)
    path = [start] if start in field else []
    while path and path[-1] != goal:
        steps = map2d.neighbours(*path[-1], cell)
        i, j, _ = min(steps, key=lambda s: field.get(s[:2], math.inf) + s[2])
        path.append((i, j))
    return path


def distance_to_walls(occ, most):
    """Rings around the walls: 0 on them, then 1, 2, … up to `most`."""
    rings = np.zeros(occ.shape, int)
    wall = np.pad(occ, 1, constant_values=True)
    for turn in range(most):
        rings += ~wall[1:-1, 1:-1]
        grown = wall.copy()
        for dy in (-1, 0, 1):
            for dx in (-1, 0, 1):
                if turn % 2 == 0 or not (dx and dy):
                    grown |= np.roll(wall, (dy, dx), (0, 1))
        wall = grown
    return rings


def cost_field(goal):
    occ = sensors.load_occupancy(MAP_IMG)
    radius = math.ceil(_ROBOT["radius"])
    rings = distance_to_walls(occ, 2 * radius)
    room = OccMap2D(rings < radius + 2)
    price = np.where(rings < 2 * radius, 3.0, 1.0).tolist()
    return room, spread(room, nearest_free(room, *goal, 60), 1, price)


FIELD = {}


def reset(obs):
    FIELD.clear()
    FIELD.update(cost_field(obs["goal"].tolist())[1])


def downhill(x, y):
    """The lowest pixel about LOOKAHEAD px away, followed from pixel to pixel."""
    here = min(
        ((i, j) for i in range(x - 9, x + 10) for j in range(y - 9, y + 10)),
        key=lambda p: (p not in FIELD, math.hypot(p[0] - x, p[1] - y)),
    )
    for _ in range(LOOKAHEAD):
        around = [(here[0] + a, here[1] + b) for a in (-1, 0, 1) for b in (-1, 0, 1)]
        here = min(around, key=lambda p: FIELD.get(p, math.inf))
    return here


def policy(obs):
    if not FIELD:
        reset(obs)
    x, y, heading = obs["pose"].tolist()
    goal = obs["goal"].tolist()
    near = math.dist((x, y), goal) < LOOKAHEAD
    aim = goal if near else downhill(round(x), round(y))
    error = math.atan2(aim[1] - y, aim[0] - x) - heading
    error = math.atan2(math.sin(error), math.cos(error))
    speed = 0.6 * max(math.cos(error), 0.0) ** 3
    turn = 0.4 * math.tanh(2.0 * error)
    return speed + turn, speed - turn


def run_episode(env, max_steps):
    obs, info = env.reset()
    reset(obs)
    positions, speeds = [tuple(obs["pose"][:2].tolist())], []
    done = False
    while not done and len(speeds) < max_steps:
        left, right = policy(obs)
        obs, _, terminated, truncated, info = env.step((left, right))
        positions.append(tuple(obs["pose"][:2].tolist()))
        speeds.append(0.5 * (left + right) * _ROBOT["max_wheel_speed"])
        done = terminated or truncated
    return {
        "positions": positions,
        "speeds": speeds,
        "collisions": info["collisions"],
        "goal": tuple(obs["goal"].tolist()),
        "dt": 0.05,
    }


def main():
    sensors.show(policy, reset)


if __name__ == "__main__":
    main()
