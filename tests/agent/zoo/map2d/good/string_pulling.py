# idea: A* pulled straight: turn in place at each corner, drive straight between
# profile: paper
"""Corners of the pulled path; at each the robot turns, then drives straight on."""

import heapq
import math
from itertools import pairwise

import numpy as np
import sensors

MAP_IMG = "occupancy.npy"
PARAMS_JSON = "params.json"
ROBOT_IMG = "robot.png"
PARAMS = sensors.load_params(PARAMS_JSON)
ROBOT = PARAMS["robot"]
AXLE_LENGTH_PX = ROBOT["axle_length"]
SENSOR_RANGE_PX = ROBOT["range_max"]
SENSOR_FOV_DEG = ROBOT["field_of_view_deg"]
N_RAYS = ROBOT["n_rays"]
LOOKAHEAD = 0.0
STOP_DIST = 2.0  # from a corner, where the next leg begins
SLOW_DIST = 8.0
STEP = ROBOT["max_wheel_speed"] * 0.05  # px a step at full speed


class OccMap2D:
    def __init__(self, occ):
        self.rim = np.pad(np.asarray(occ, bool), 1, constant_values=True)

    def is_occupied(self, x, y):
        height, width = self.rim.shape
        row, column = min(max(y + 1, 0), height - 1), min(max(x + 1, 0), width - 1)
        return bool(self.rim[row, column])


def nearest_free(map2d, x, y, max_rad):
    x, y = int(x), int(y)
    spiral = sorted(
        (dx * dx + dy * dy, dx, dy)
        for dx in range(-int(max_rad), int(max_rad) + 1)
        for dy in range(-int(max_rad), int(max_rad) + 1)
        if dx * dx + dy * dy <= max_rad**2
    )
    for _, dx, dy in spiral:
        if not map2d.is_occupied(x + dx, y + dy):
            return x + dx, y + dy
    raise ValueError("no free pixel near by")


def successors(map2d, x, y, cell):
    for dx, dy in (
        (1, 0),
        (-1, 0),
        (0, 1),
        (0, -1),
        (1, 1),
        (1, -1),
        (-1, 1),
        (-1, -1),
    ):
        a, b = x, y
        for _ in range(cell):
            blocked = map2d.is_occupied(a + dx, b + dy)
            blocked |= map2d.is_occupied(a + dx, b) or map2d.is_occupied(a, b + dy)
            if blocked:
                break
            a, b = a + dx, b + dy
        else:
            yield (a, b), cell * math.hypot(dx, dy)


def plan_path(map2d, start, goal, cell):
    start, goal = (int(start[0]), int(start[1])), (int(goal[0]), int(goal[1]))
    if map2d.is_occupied(*start) or map2d.is_occupied(*goal):
        return []

    def rest(point):
        dx, dy = abs(point[0] - goal[0]), abs(point[1] - goal[1])
        return max(dx, dy) + (math.sqrt(2) - 1) * min(dx, dy)

    best, parents = {start: 0.0}, {}
    queue = [(rest(start), 0.0, start)]
    while queue:
        _, cost, here = heapq.heappop(queue)
        if here == goal:
            path = [goal]
            while path[-1] != start:
                path.append(parents[path[-1]])
            return path[::-1]
        if cost > best[here]:
            continue
        for there, length in successors(map2d, *here, cell):
            after = cost + length
            if after < best.get(there, math.inf) - 1e-9:
                best[there], parents[there] = after, here
                heapq.heappush(queue, (after + rest(there), after, there))
    return []


def grown(occ, radius):
    """Obstacles and rim grown by a disc, row by row."""
    reach = math.ceil(radius)
    padded = np.pad(occ, reach, constant_values=True)
    result = np.zeros_like(occ)
    for dy in range(-reach, reach + 1):
        half = math.floor(math.sqrt(max(radius**2 - dy**2, 0.0)))
        rows = padded[reach + dy : reach + dy + occ.shape[0]]
        for dx in range(-half, half + 1):
            result |= rows[:, reach + dx : reach + dx + occ.shape[1]]
    return result


def is_straight_way(map2d, a, b):
    count = 2 * math.ceil(math.dist(a, b)) + 1
    points = zip(
        np.linspace(a[0], b[0], count), np.linspace(a[1], b[1], count), strict=True
    )
    return not any(map2d.is_occupied(round(x), round(y)) for x, y in points)


def pulled(map2d, path):
    """Corners of the path: from each, the farthest point in sight."""
    corners = path[:1]
    while path and corners[-1] != path[-1]:
        begin = path.index(corners[-1])
        end = len(path) - 1
        while end > begin + 1 and not is_straight_way(map2d, path[begin], path[end]):
            end = begin + (end - begin) * 9 // 10
        corners.append(path[end])
    return corners


LEGS = []


def reset(obs):
    room = OccMap2D(grown(sensors.load_occupancy(MAP_IMG), ROBOT["radius"] + 4))
    x, y, _ = obs["pose"].tolist()
    start = nearest_free(room, round(x), round(y), 60)
    goal = tuple(obs["goal"].tolist())
    corners = pulled(room, plan_path(room, start, nearest_free(room, *goal, 60), 1))
    if corners[0] != (round(x), round(y)):
        corners.insert(0, (round(x), round(y)))
    LEGS[:] = [end for _, end in pairwise(corners)]
    LEGS.append(goal)


def policy(obs):
    if not LEGS:
        reset(obs)
    x, y, heading = obs["pose"].tolist()
    while len(LEGS) > 1 and math.dist(LEGS[0], (x, y)) < STOP_DIST:
        LEGS.pop(0)
    far = math.dist(LEGS[0], (x, y))
    error = math.remainder(
        math.atan2(LEGS[0][1] - y, LEGS[0][0] - x) - heading, 2 * math.pi
    )
    turn = error * AXLE_LENGTH_PX / (2 * STEP)
    if abs(error) > 0.1:
        turn = max(-0.8, min(0.8, turn))
        return turn, -turn
    speed = 0.8 if far > SLOW_DIST else max(0.15, 0.8 * far / SLOW_DIST)
    turn = max(-0.2, min(0.2, turn))
    return speed + turn, speed - turn


def run_episode(env, max_steps):
    obs, info = env.reset()
    reset(obs)
    log = {"positions": [tuple(obs["pose"][:2].tolist())], "speeds": []}
    for _ in range(max_steps):
        wheels = policy(obs)
        obs, _, terminated, truncated, info = env.step(wheels)
        log["positions"].append(tuple(obs["pose"][:2].tolist()))
        log["speeds"].append(sum(wheels) / 2 * ROBOT["max_wheel_speed"])
        if terminated or truncated:
            break
    log["collisions"] = info["collisions"]
    log["goal"] = tuple(obs["goal"].tolist())
    log["dt"] = 0.05
    return log


def main():
    sensors.show(policy, reset)


if __name__ == "__main__":
    main()
