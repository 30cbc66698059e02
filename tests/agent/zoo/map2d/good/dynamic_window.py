# idea: a dynamic view: of 45 wheel speeds, the one whose next arc scores best
# profile: paper
"""DWA over a plan: arcs are rolled out and scored by field, clearance and speed."""

import heapq
import math

import numpy as np
import sensors

MAP_IMG = "occupancy.npy"
PARAMS_JSON = "params.json"
ROBOT_IMG = "robot.png"
ROBOT = sensors.load_params(PARAMS_JSON)["robot"]
AXLE_LENGTH_PX = ROBOT["axle_length"]
SENSOR_RANGE_PX = ROBOT["range_max"]
SENSOR_FOV_DEG = ROBOT["field_of_view_deg"]
N_RAYS = ROBOT["n_rays"]
SPEED, DT = ROBOT["max_wheel_speed"], 0.05
LOOKAHEAD = 0.35  # length of an arc, s
STOP_DIST = ROBOT["radius"] + 1.0
SLOW_DIST = ROBOT["radius"] + 6.0


class OccMap2D:
    def __init__(self, occ):
        self.occ = np.asarray(occ, bool)
        self.height, self.width = self.occ.shape

    def is_occupied(self, x, y):
        if 0 <= x < self.width and 0 <= y < self.height:
            return bool(self.occ[y, x])
        return True


def nearest_free(map2d, x, y, max_rad):
    ys, xs = np.nonzero(~map2d.occ)
    away = np.hypot(xs - x, ys - y)
    if away.size == 0 or away.min() > max_rad:
        raise ValueError(f"no free pixel within {max_rad} px of ({x}, {y})")
    k = int(np.argmin(away))
    return int(xs[k]), int(ys[k])


def open_steps(map2d, x, y, cell):
    """The pixels that one free step of `cell` px leads to, with its length."""
    for dx in (-1, 0, 1):
        for dy in (-1, 0, 1):
            if not dx and not dy:
                continue
            for k in range(cell):
                a, b = x + k * dx, y + k * dy
                if (
                    map2d.is_occupied(a + dx, b + dy)
                    or map2d.is_occupied(a + dx, b)
                    or map2d.is_occupied(a, b + dy)
                ):
                    break
            else:
                yield (x + cell * dx, y + cell * dy), cell * math.hypot(dx, dy)


def distances(map2d, source, cell, until=None):
    """Path length from `source` to every pixel it is joined with."""
    found, queue = {}, [(0.0, source)]
    while queue:
        cost, here = heapq.heappop(queue)
        if here in found:
            continue
        found[here] = cost
        if here == until:
            break
        for there, length in open_steps(map2d, *here, cell):
            if there not in found:
                heapq.heappush(queue, (cost + length, there))
    return found


def plan_path(map2d, start, goal, cell):
    start, goal = (int(start[0]), int(start[1])), (int(goal[0]), int(goal[1]))
    if map2d.is_occupied(*start) or map2d.is_occupied(*goal):
        return []
    costs = distances(map2d, goal, cell, until=start)
    if start not in costs:
        return []
    path = [start]
    while path[-1] != goal:
        options = open_steps(map2d, *path[-1], cell)
        path.append(min(options, key=lambda s: costs.get(s[0], math.inf) + s[1])[0])
    return path


def inflated(occ, radius):
    reach = math.ceil(radius)
    padded = np.pad(occ, reach, constant_values=True)
    grown = np.zeros_like(occ)
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            if math.hypot(dx, dy) <= radius:
                view = padded[reach + dy :, reach + dx :]
                grown |= view[: occ.shape[0], : occ.shape[1]]
    return grown


def clearance(occ, most):
    """Distance of each pixel to the nearest wall or rim, up to `most` px."""
    free = np.full(occ.shape, float(most))
    reach = math.ceil(most)
    padded = np.pad(occ, reach, constant_values=True)
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            view = padded[reach + dy :, reach + dx :][: occ.shape[0], : occ.shape[1]]
            free[view] = np.minimum(free[view], math.hypot(dx, dy))
    return free


FIELD = {}
SPEEDS = [
    (forward + turn, forward - turn)
    for forward in (0.0, 0.15, 0.35, 0.5, 0.7)
    for turn in (-0.3, -0.2, -0.1, -0.04, 0.0, 0.04, 0.1, 0.2, 0.3)
]


def reset(obs):
    occ = sensors.load_occupancy(MAP_IMG)
    room = OccMap2D(inflated(occ, STOP_DIST + 1.0))
    goal = nearest_free(room, float(obs["goal"][0]), float(obs["goal"][1]), 60)
    field = np.full(occ.shape, 1e4)
    for (x, y), length in distances(room, goal, 1).items():
        field[y, x] = length
    FIELD.update(cost=field, clear=clearance(occ, SLOW_DIST))


def arc(x, y, heading, left, right):
    """Poses along an arc of constant wheel speeds."""
    poses = []
    for _ in range(round(LOOKAHEAD / DT)):
        heading += (left - right) * SPEED * DT / AXLE_LENGTH_PX
        x += (left + right) / 2 * SPEED * DT * math.cos(heading)
        y += (left + right) / 2 * SPEED * DT * math.sin(heading)
        poses.append((x, y, heading))
    return poses


def look_up(field, x, y):
    height, width = field.shape
    return float(
        field[min(max(round(y), 0), height - 1), min(max(round(x), 0), width - 1)]
    )


def score(poses, goal):
    """Lower is better: way left from the arc's end and from a point ahead of it."""
    room = min(look_up(FIELD["clear"], x, y) for x, y, _ in poses)
    if room < STOP_DIST:
        return math.inf
    x, y, heading = poses[-1]
    ahead = (x + 6 * math.cos(heading), y + 6 * math.sin(heading))
    ways = [look_up(FIELD["cost"], *point) for point in ((x, y), ahead)]
    if math.dist((x, y), goal) < 15:
        ways = [math.dist((x, y), goal), math.dist(ahead, goal)]
    return 0.5 * sum(ways) + 0.5 * (SLOW_DIST - room)


def policy(obs):
    if not FIELD:
        reset(obs)
    x, y, heading = map(float, obs["pose"])
    goal = tuple(map(float, obs["goal"]))
    costs = [score(arc(x, y, heading, *wheels), goal) for wheels in SPEEDS]
    best = min(range(len(SPEEDS)), key=costs.__getitem__)
    return SPEEDS[best] if math.isfinite(costs[best]) else (0.2, -0.2)


def run_episode(env, max_steps):
    obs, info = env.reset()
    reset(obs)
    positions, speeds = [(float(obs["pose"][0]), float(obs["pose"][1]))], []
    for _ in range(max_steps):
        left, right = policy(obs)
        obs, _, terminated, truncated, info = env.step((left, right))
        positions.append((float(obs["pose"][0]), float(obs["pose"][1])))
        speeds.append((left + right) / 2 * SPEED)
        if terminated or truncated:
            break
    return {
        "positions": positions,
        "speeds": speeds,
        "collisions": info["collisions"],
        "goal": (float(obs["goal"][0]), float(obs["goal"][1])),
        "dt": DT,
    }


def main():
    sensors.show(policy, reset)


if __name__ == "__main__":
    main()
