# idea: everything as whole-array NumPy: dilation, wavefront, clearance, steering
# profile: paper
"""Wavefront planning in whole-array operations; no loop over pixels."""

import numpy as np
import sensors

MAP_IMG, PARAMS_JSON, ROBOT_IMG = "occupancy.npy", "params.json", "robot.png"
ROBOT = sensors.load_params(PARAMS_JSON)["robot"]
AXLE_LENGTH_PX = ROBOT["axle_length"]
SENSOR_RANGE_PX = ROBOT["range_max"]
SENSOR_FOV_DEG = ROBOT["field_of_view_deg"]
N_RAYS = ROBOT["n_rays"]
LOOKAHEAD, STOP_DIST, SLOW_DIST = 10, 0, 0
MARGIN = 2.5

# Straight neighbours first, then diagonal ones: rows of (dy, dx).
TURNS = np.array([(0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, -1), (-1, 1)])
LENGTHS = np.hypot(*TURNS.T)


class OccMap2D:
    def __init__(self, occ):
        self.occ = np.array(occ, bool)

    def is_occupied(self, x, y):
        rows, columns = self.occ.shape
        return bool(not (0 <= x < columns and 0 <= y < rows) or self.occ[y, x])


def nearest_free(map2d, x, y, max_rad):
    x, y = int(np.rint(x)), int(np.rint(y))
    free = np.argwhere(~map2d.occ)
    if not len(free):
        raise ValueError("the map is full")
    distances = np.hypot(free[:, 1] - x, free[:, 0] - y)
    best = distances.argmin()
    if distances[best] > max_rad:
        raise ValueError(f"nearest free pixel is {distances[best]:.1f} px away")
    return int(free[best, 1]), int(free[best, 0])


def shifted(array, dy, dx, cell, fill):
    """The array as seen from each pixel's neighbour, `fill` beyond the rim."""
    rows, columns = array.shape
    padded = np.pad(array, cell, constant_values=fill)
    top, left = cell + dy * cell, cell + dx * cell
    return padded[top : top + rows, left : left + columns]


def open_ways(occ, cell):
    """For each of the eight turns: from which pixels `cell` single steps are free."""
    ways = []
    for dy, dx in TURNS:
        way = ~occ
        for k in range(1, cell + 1):
            walls = np.pad(occ, k, constant_values=True)

            def at(a, b, walls=walls, k=k):
                return walls[k + a : k + a + occ.shape[0], k + b : k + b + occ.shape[1]]

            way = way & ~at(k * dy, k * dx)
            if dy and dx:
                way &= ~at(k * dy, (k - 1) * dx) & ~at((k - 1) * dy, k * dx)
        ways.append(way)
    return ways


def wavefront(occ, goal, cell=1, start=None):
    """Octile distance of each pixel to `goal`, relaxed until nothing changes."""
    field = np.full(occ.shape, np.inf)
    field[goal[1], goal[0]] = 0.0
    ways = open_ways(occ, cell)
    while True:
        before = field
        for (dy, dx), length, way in zip(TURNS, LENGTHS, ways, strict=True):
            through = shifted(field, dy, dx, cell, np.inf) + length * cell
            field = np.where(way, np.minimum(field, through), field)
        if np.array_equal(before, field):
            return field


def plan_path(map2d, start, goal, cell):
    (x, y), goal = map(int, start), (int(goal[0]), int(goal[1]))
    if map2d.is_occupied(x, y) or map2d.is_occupied(*goal):
        return []
    field, ways = wavefront(map2d.occ, goal, cell), open_ways(map2d.occ, cell)
    if np.isinf(field[y, x]):
        return []
    path = [(x, y)]
    while path[-1] != goal:
        free = [k for k in range(8) if ways[k][y, x]]
        after = [(y + TURNS[k, 0] * cell, x + TURNS[k, 1] * cell) for k in free]
        costs = [field[p] + LENGTHS[k] * cell for p, k in zip(after, free, strict=True)]
        y, x = map(int, after[int(np.argmin(costs))])
        path.append((x, y))
    return path


def dilated(occ, radius):
    """The map and its rim, grown by a disc."""
    reach = int(np.ceil(radius))
    dy, dx = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    disc = np.argwhere(np.hypot(dy, dx) <= radius)
    padded = np.pad(occ, reach, constant_values=True)
    rows, columns = occ.shape
    return np.any([padded[a : a + rows, b : b + columns] for a, b in disc], axis=0)


OCC = sensors.load_occupancy(MAP_IMG)
ROOM = OccMap2D(dilated(OCC, ROBOT["radius"] + MARGIN))
STATE = {}


def reset(obs):
    start = nearest_free(ROOM, *obs["pose"][:2], 60)
    goal = nearest_free(ROOM, *obs["goal"], 60)
    STATE["path"] = np.array(plan_path(ROOM, start, goal, 1), float)


def policy(obs):
    if not STATE:
        reset(obs)
    path, position, heading = STATE["path"], obs["pose"][:2], obs["pose"][2]
    nearest = np.hypot(*(path - position).T).argmin()
    aim = path[min(nearest + LOOKAHEAD, len(path) - 1)]
    if nearest + LOOKAHEAD >= len(path):
        aim = obs["goal"]
    across, along = (aim - position)[::-1] @ np.array(
        [[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]]
    )
    error = np.arctan2(across, along)
    forward = np.where(np.abs(error) < 0.5, 0.7, 0.0)
    turn = np.clip(0.7 * error, -0.3, 0.3)
    return np.clip(np.array([forward + turn, forward - turn]), -1.0, 1.0)


def run_episode(env, max_steps):
    obs, info = env.reset()
    reset(obs)
    poses, wheels = [obs["pose"][:2]], []
    for _ in range(max_steps):
        wheels.append(policy(obs))
        obs, _, terminated, truncated, info = env.step(wheels[-1])
        poses.append(obs["pose"][:2])
        if terminated or truncated:
            break
    return {
        "positions": [(float(x), float(y)) for x, y in poses],
        "speeds": (np.mean(wheels, axis=1) * ROBOT["max_wheel_speed"]).tolist(),
        "collisions": int(info["collisions"]),
        "goal": (float(obs["goal"][0]), float(obs["goal"][1])),
        "dt": 0.05,
    }


def main():
    sensors.show(policy, reset)


if __name__ == "__main__":
    main()
