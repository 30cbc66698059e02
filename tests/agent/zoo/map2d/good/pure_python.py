# idea: lists and tuples only; NumPy does not appear after the map is loaded
# profile: paper
"""Breadth-first search and Theta*-like shortcuts in pure Python."""

import heapq
import math

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
LOOKAHEAD = 16
STOP_DIST = 6
SLOW_DIST = 12
FULL_STEP = ROBOT["max_wheel_speed"] * 0.05


class OccMap2D:
    def __init__(self, occ):
        self.rows = [[bool(cell) for cell in row] for row in occ]
        self.height, self.width = len(self.rows), len(self.rows[0])

    def is_occupied(self, x, y):
        if x < 0 or y < 0:
            return True
        try:
            return self.rows[y][x]
        except IndexError:
            return True


def nearest_free(map2d, x, y, max_rad):
    best, reach = None, int(max_rad)
    for j in range(max(y - reach, 0), min(y + reach + 1, map2d.height)):
        for i in range(max(x - reach, 0), min(x + reach + 1, map2d.width)):
            square = (i - x) ** 2 + (j - y) ** 2
            if map2d.rows[j][i] or square > max_rad**2:
                continue
            if best is None or square < best[0]:
                best = (square, i, j)
    if best is None:
        raise ValueError("no free pixel in reach")
    return best[1], best[2]


def plan_path(map2d, start, goal, cell):
    start, goal = (int(start[0]), int(start[1])), (int(goal[0]), int(goal[1]))
    if map2d.is_occupied(*start) or map2d.is_occupied(*goal):
        return []
    came, costs, heap = {start: start}, {start: 0.0}, [(0.0, start)]
    done = set()
    while heap:
        _, here = heapq.heappop(heap)
        if here == goal:
            break
        if here in done:
            continue
        done.add(here)
        for dx, dy in DIRECTIONS:
            there = stride(map2d, here, dx, dy, cell)
            if there is None:
                continue
            cost = costs[here] + (1.41421356 if dx and dy else 1.0) * cell
            if cost < costs.get(there, 1e18):
                costs[there], came[there] = cost, here
                heapq.heappush(heap, (cost + bound(there, goal), there))
    if goal not in came:
        return []
    path = [goal]
    while path[-1] != start:
        path.append(came[path[-1]])
    path.reverse()
    return path


DIRECTIONS = [(0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)]


def stride(map2d, here, dx, dy, cell):
    x, y = here
    for _ in range(cell):
        if dx and dy and (map2d.is_occupied(x + dx, y) or map2d.is_occupied(x, y + dy)):
            return None
        x, y = x + dx, y + dy
        if map2d.is_occupied(x, y):
            return None
    return x, y


def bound(a, b):
    dx, dy = abs(a[0] - b[0]), abs(a[1] - b[1])
    return dx + dy - 0.58578643 * min(dx, dy)


def inflated(map2d, radius):
    """A map grown by a disc, written obstacle by obstacle."""
    reach = math.ceil(radius)
    disc = [
        (dx, dy)
        for dx in range(-reach, reach + 1)
        for dy in range(-reach, reach + 1)
        if dx * dx + dy * dy <= radius * radius
    ]
    grown = [row[:] for row in map2d.rows]
    for y in range(-1, map2d.height + 1):
        for x in range(-1, map2d.width + 1):
            around = (stride(map2d, (x, y), dx, dy, 1) for dx, dy in DIRECTIONS[:4])
            if map2d.is_occupied(x, y) and any(around):
                for dx, dy in disc:
                    if 0 <= x + dx < map2d.width and 0 <= y + dy < map2d.height:
                        grown[y + dy][x + dx] = True
    return OccMap2D(grown)


def in_sight(map2d, a, b):
    count = 2 * int(math.dist(a, b)) + 2
    for k in range(count + 1):
        x = a[0] + (b[0] - a[0]) * k / count
        y = a[1] + (b[1] - a[1]) * k / count
        if map2d.is_occupied(int(x + 0.5), int(y + 0.5)):
            return False
    return True


EPISODE = {}


def reset(obs):
    room = inflated(OccMap2D(sensors.load_occupancy(MAP_IMG)), ROBOT["radius"] + 3)
    x, y, _ = obs["pose"].tolist()
    goal = obs["goal"].tolist()
    start = nearest_free(room, round(x), round(y), 50)
    end = nearest_free(room, round(goal[0]), round(goal[1]), 50)
    path = plan_path(room, start, end, 1)
    EPISODE.update(room=room, path=path, at=0)


def policy(obs):
    if not EPISODE:
        reset(obs)
    x, y, heading = obs["pose"].tolist()
    room, path, at = EPISODE["room"], EPISODE["path"], EPISODE["at"]
    while at < len(path) - 1 and math.dist(path[at], (x, y)) > math.dist(
        path[at + 1], (x, y)
    ):
        at += 1
    EPISODE["at"] = at
    ahead = min(at + LOOKAHEAD, len(path) - 1)
    while ahead > at + 3 and not in_sight(room, (x, y), path[ahead]):
        ahead -= 1
    aim = obs["goal"].tolist() if ahead == len(path) - 1 else path[ahead]
    error = math.remainder(math.atan2(aim[1] - y, aim[0] - x) - heading, 2 * math.pi)
    turn = error * AXLE_LENGTH_PX / (2 * FULL_STEP)
    turn = min(max(0.6 * turn, -0.35), 0.35)
    if abs(error) > 0.5:
        return turn, -turn
    front = min(obs["ranges"].tolist()[N_RAYS // 2 - 1 : N_RAYS // 2 + 1])
    speed = 0.65 if front > SLOW_DIST else 0.4 if front > STOP_DIST else 0.2
    return speed + turn, speed - turn


def run_episode(env, max_steps):
    obs, info = env.reset()
    reset(obs)
    x, y, _ = obs["pose"].tolist()
    positions, speeds = [(x, y)], []
    for _ in range(max_steps):
        left, right = policy(obs)
        obs, _, terminated, truncated, info = env.step((left, right))
        x, y, _ = obs["pose"].tolist()
        positions.append((x, y))
        speeds.append((left + right) / 2 * ROBOT["max_wheel_speed"])
        if terminated or truncated:
            break
    goal_x, goal_y = obs["goal"].tolist()
    return {
        "positions": positions,
        "speeds": speeds,
        "collisions": info["collisions"],
        "goal": (goal_x, goal_y),
        "dt": 0.05,
    }


def main():
    sensors.show(policy, reset)


if __name__ == "__main__":
    main()
