# idea: the path smoothed by a cubic B-spline, followed by Stanley's steering law
# profile: paper
"""A* on a lattice, corners rounded by a B-spline, heading and cross-track feedback."""

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
LOOKAHEAD = 5.0
STOP_DIST = 0.0
SLOW_DIST = 12.0
MARGIN = 4.0
KNOTS = 8  # path pixels from one control point to the next


class OccMap2D:
    def __init__(self, occ):
        self.occ = np.asarray(occ, bool)

    def is_occupied(self, x, y):
        height, width = self.occ.shape
        return bool(x < 0 or y < 0 or x >= width or y >= height or self.occ[y, x])


def nearest_free(map2d, x, y, max_rad):
    for radius2 in range(math.floor(max_rad**2) + 1):
        for dx in range(math.isqrt(radius2) + 1):
            dy = math.isqrt(radius2 - dx * dx)
            if dx * dx + dy * dy != radius2:
                continue
            for a, b in ((dx, dy), (-dx, dy), (dx, -dy), (-dx, -dy)):
                if not map2d.is_occupied(int(x) + a, int(y) + b):
                    return int(x) + a, int(y) + b
    raise ValueError(f"no free pixel within {max_rad} px of ({x}, {y})")


def plan_path(map2d, start, goal, cell):
    start, goal = tuple(map(int, start)), tuple(map(int, goal))
    if map2d.is_occupied(*start) or map2d.is_occupied(*goal):
        return []
    queue, parent, cost = [(0.0, 0.0, start)], {start: None}, {start: 0.0}
    while queue:
        _, spent, (x, y) = heapq.heappop(queue)
        if (x, y) == goal:
            path = [goal]
            while parent[path[0]] is not None:
                path.insert(0, parent[path[0]])
            return path
        if spent > cost[x, y]:
            continue
        for column, row in np.ndindex(3, 3):
            dx, dy = column - 1, row - 1
            there = (x + cell * dx, y + cell * dy)
            price = spent + cell * math.hypot(dx, dy)
            if price < cost.get(there, math.inf) and can_go(map2d, x, y, dx, dy, cell):
                cost[there], parent[there] = price, (x, y)
                rank = price + math.dist(there, goal)
                heapq.heappush(queue, (rank, price, there))
    return []


def can_go(map2d, x, y, dx, dy, cell):
    for k in range(cell):
        a, b = x + k * dx, y + k * dy
        if map2d.is_occupied(a + dx, b + dy):
            return False
        if map2d.is_occupied(a + dx, b) or map2d.is_occupied(a, b + dy):
            return False
    return True


def body_map(occ, radius):
    reach = math.ceil(radius)
    padded = np.pad(occ, reach, constant_values=True)
    kernel = np.hypot(*np.mgrid[-reach : reach + 1, -reach : reach + 1]) <= radius
    windows = np.lib.stride_tricks.sliding_window_view(padded, kernel.shape)
    return OccMap2D((windows & kernel).any(axis=(2, 3)))


def spline(points):
    """A uniform cubic B-spline through a control polygon, its ends held fast."""
    points = np.array([points[0]] * 2 + points + [points[-1]] * 2, float)
    t = np.linspace(0, 1, 8, endpoint=False)[:, None]
    basis = np.hstack(
        [(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3]
    )
    return np.vstack([basis @ points[k : k + 4] / 6 for k in range(len(points) - 3)])


CURVE = []


def reset(obs):
    room = body_map(sensors.load_occupancy(MAP_IMG), ROBOT["radius"] + MARGIN)
    x, y, _ = obs["pose"].tolist()
    goal = obs["goal"].tolist()
    start = nearest_free(room, round(x), round(y), 60)
    end = nearest_free(room, round(goal[0]), round(goal[1]), 60)
    path = plan_path(room, start, end, 1)
    CURVE[:] = [spline([(x, y), *path[KNOTS:-KNOTS:KNOTS], tuple(goal)])]


def policy(obs):
    if not CURVE:
        reset(obs)
    curve, (x, y, heading) = CURVE[0], obs["pose"].tolist()
    front = np.array([x, y]) + LOOKAHEAD * np.array(
        [math.cos(heading), math.sin(heading)]
    )
    k = min(int(np.hypot(*(curve - front).T).argmin()), len(curve) - 2)
    tangent = curve[k + 1] - curve[k]
    if not tangent.any():
        tangent = obs["goal"] - np.array([x, y])
    direction = math.atan2(tangent[1], tangent[0])
    away = front - curve[k]
    across = away[1] * math.cos(direction) - away[0] * math.sin(direction)
    error = math.remainder(direction - math.atan2(across, 4.0) - heading, math.tau)
    left_to_go = math.dist((x, y), obs["goal"].tolist())
    speed = 0.6 * min(1.0, 0.3 + left_to_go / SLOW_DIST) if abs(error) < 0.8 else 0.0
    turn = max(-0.4, min(0.4, 0.8 * error))
    return speed + turn, speed - turn


def run_episode(env, max_steps):
    obs, info = env.reset()
    reset(obs)
    goal = tuple(obs["goal"].tolist())
    result = {"positions": [], "speeds": [], "collisions": 0, "goal": goal, "dt": 0.05}
    result["positions"].append(tuple(obs["pose"].tolist()[:2]))
    for _ in range(max_steps):
        left, right = policy(obs)
        obs, _, terminated, truncated, info = env.step([left, right])
        result["positions"].append(tuple(obs["pose"].tolist()[:2]))
        result["speeds"].append((left + right) / 2 * ROBOT["max_wheel_speed"])
        result["collisions"] = info["collisions"]
        if terminated or truncated:
            break
    return result


def main():
    sensors.show(policy, reset)


if __name__ == "__main__":
    main()
