# idea: functions that return functions; no class but the one of the contract
# profile: paper
"""Each stage is a closure: `searcher`, `follower`, `brake`; `reset` wires them up."""

import math
from heapq import heappop, heappush

import numpy as np
import sensors

MAP_IMG, PARAMS_JSON, ROBOT_IMG = "occupancy.png", "params.json", "robot.png"
LOOKAHEAD, STOP_DIST, SLOW_DIST = 12.0, 7.0, 16.0
_params = sensors.load_params(PARAMS_JSON)
_robot = _params["robot"]
AXLE_LENGTH_PX = _robot["axle_length"]
SENSOR_RANGE_PX = _robot["range_max"]
SENSOR_FOV_DEG = _robot["field_of_view_deg"]
N_RAYS = _robot["n_rays"]


class OccMap2D:
    def __init__(self, occ):
        rows = np.asarray(occ, bool).tolist()
        height, width = len(rows), len(rows[0])

        def is_occupied(x, y):
            return not (0 <= x < width and 0 <= y < height) or rows[y][x]

        self.is_occupied, self.size = is_occupied, (width, height)


def nearest_free(map2d, x, y, max_rad):
    def candidates():
        reach = int(max_rad)
        for j in range(int(y) - reach, int(y) + reach + 1):
            for i in range(int(x) - reach, int(x) + reach + 1):
                distance = math.hypot(i - x, j - y)
                if distance <= max_rad and not map2d.is_occupied(i, j):
                    yield distance, i, j

    best = min(candidates(), default=None)
    if best is None:
        raise ValueError(f"nothing free around ({x}, {y})")
    return best[1:]


def searcher(occupied, cell, estimate):
    """A function that finds the shortest path between two pixels."""

    def steps(x, y):
        for dx, dy in ((1, 0), (0, 1), (-1, 0), (0, -1)):
            if all(not occupied(x + k * dx, y + k * dy) for k in range(1, cell + 1)):
                yield x + cell * dx, y + cell * dy, cell
        for dx, dy in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            if all(free(x + k * dx, y + k * dy, dx, dy) for k in range(cell)):
                yield x + cell * dx, y + cell * dy, cell * math.sqrt(2)

    def free(x, y, dx, dy):
        corners = (occupied(x + dx, y), occupied(x, y + dy), occupied(x + dx, y + dy))
        return not any(corners)

    def search(start, goal):
        if occupied(*start) or occupied(*goal):
            return []
        best, before = {start: 0.0}, {}
        queue = [(estimate(start, goal), start)]
        while queue:
            rank, here = heappop(queue)
            if here == goal:
                return unwind(before, goal)
            if rank > best[here] + estimate(here, goal) + 1e-9:
                continue
            for x, y, length in steps(*here):
                cost = best[here] + length
                if cost < best.get((x, y), math.inf):
                    best[x, y], before[x, y] = cost, here
                    heappush(queue, (cost + estimate((x, y), goal), (x, y)))
        return []

    return search


def unwind(before, point):
    path = [point]
    while path[-1] in before:
        path.append(before[path[-1]])
    return path[::-1]


def octile(a, b):
    dx, dy = abs(a[0] - b[0]), abs(a[1] - b[1])
    return max(dx, dy) + 0.41421356 * min(dx, dy)


def plan_path(map2d, start, goal, cell):
    search = searcher(map2d.is_occupied, cell, octile)
    return search((int(start[0]), int(start[1])), (int(goal[0]), int(goal[1])))


def fattened(occ, radius):
    """Occupied within `radius`, by growing columns first and then rows."""
    reach = math.ceil(radius)
    padded = np.pad(occ, reach, constant_values=True)
    shape, result = occ.shape, np.zeros(occ.shape, bool)
    for dy in range(-reach, reach + 1):
        half = math.isqrt(max(int(radius**2) - dy**2, 0))
        band = padded[reach + dy : reach + dy + shape[0]]
        for dx in range(-half, half + 1):
            result |= band[:, reach + dx : reach + dx + shape[1]]
    return result


def follower(path, goal):
    """A function that gives the point to aim at."""
    place = [0]

    def aim(x, y):
        while (
            place[0] < len(path) - 1 and math.dist(path[place[0]], (x, y)) < LOOKAHEAD
        ):
            place[0] += 1
        return path[place[0]] if place[0] < len(path) - 1 else goal

    return aim


def brake(stop, slow):
    """A function from the free distance ahead to a share of the speed."""
    return lambda ahead: min(max((ahead - stop) / (slow - stop), 0.25), 1.0)


def pilot(obs):
    room = OccMap2D(fattened(sensors.load_occupancy(MAP_IMG), _robot["radius"] + 3))
    goal = tuple(obs["goal"].tolist())
    ends = [
        nearest_free(room, round(x), round(y), 50) for x, y in (obs["pose"][:2], goal)
    ]
    aim = follower(plan_path(room, *ends, 1), goal)
    slowed = brake(STOP_DIST, SLOW_DIST)

    def act(obs):
        x, y, heading = obs["pose"].tolist()
        to_x, to_y = aim(x, y)
        error = math.remainder(math.atan2(to_y - y, to_x - x) - heading, math.tau)
        ahead = float(obs["ranges"][N_RAYS // 2 - 2 : N_RAYS // 2 + 2].min())
        speed = 0.65 * slowed(ahead) * (abs(error) < 0.6)
        turn = math.copysign(min(abs(0.8 * error), 0.35), error)
        return speed + turn, speed - turn

    return act


_act = []


def reset(obs):
    _act[:] = [pilot(obs)]


def policy(obs):
    if not _act:
        reset(obs)
    return _act[0](obs)


def run_episode(env, max_steps):
    obs, info = env.reset()
    reset(obs)
    positions, speeds, over = [point(obs["pose"])], [], False
    while len(speeds) < max_steps and not over:
        left, right = policy(obs)
        obs, _, terminated, truncated, info = env.step((left, right))
        over = terminated or truncated
        positions.append(point(obs["pose"]))
        speeds.append((left + right) / 2 * _robot["max_wheel_speed"])
    result = {"positions": positions, "speeds": speeds, "dt": 0.05}
    return result | {"collisions": info["collisions"], "goal": point(obs["goal"])}


def point(values):
    return float(values[0]), float(values[1])


def main():
    sensors.show(policy, reset)


if __name__ == "__main__":
    main()
