# idea: A* on the inflated pixels, then pure pursuit with a fixed lookahead
# profile: paper
"""A* over the pixels that hold the body, followed by pure pursuit."""

import heapq
import math

import numpy as np
import sensors

MAP_IMG = "occupancy.png"
PARAMS_JSON = "params.json"
ROBOT_IMG = "robot.png"

PARAMS = sensors.load_params(PARAMS_JSON)
RADIUS = PARAMS["robot"]["radius"]
MAX_SPEED = PARAMS["robot"]["max_wheel_speed"]
AXLE_LENGTH_PX = PARAMS["robot"]["axle_length"]
SENSOR_RANGE_PX = PARAMS["robot"]["range_max"]
SENSOR_FOV_DEG = PARAMS["robot"]["field_of_view_deg"]
N_RAYS = PARAMS["robot"]["n_rays"]
LOOKAHEAD = 1.5 * RADIUS
STOP_DIST = 1.1 * RADIUS
SLOW_DIST = 3.0 * RADIUS
MARGIN = 3
DT = 0.05

STEPS = [
    (dx, dy, math.hypot(dx, dy)) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if dx or dy
]


class OccMap2D:
    """A map that is asked pixel by pixel."""

    def __init__(self, occ):
        self.occ = np.asarray(occ, bool)
        self.height, self.width = self.occ.shape

    def is_occupied(self, x, y):
        if x < 0 or y < 0 or x >= self.width or y >= self.height:
            return True
        return bool(self.occ[int(y), int(x)])


def nearest_free(map2d, x, y, max_rad):
    """The nearest free pixel: ring after ring, until no ring can hold a nearer one."""
    x, y = round(x), round(y)
    best = (math.inf, x, y)
    for ring in range(int(max_rad) + 1):
        if ring > best[0]:
            break
        for dx in range(-ring, ring + 1):
            edge = abs(dx) == ring
            for dy in range(-ring, ring + 1) if edge else (-ring, ring):
                distance = math.hypot(dx, dy)
                if distance < best[0] and not map2d.is_occupied(x + dx, y + dy):
                    best = (distance, x + dx, y + dy)
    if best[0] > max_rad:
        raise ValueError(f"nothing free within {max_rad} px of ({x}, {y})")
    return best[1], best[2]


def plan_path(map2d, start, goal, cell):
    """Shortest path of 8-connected steps of `cell` px."""
    start, goal = (int(start[0]), int(start[1])), (int(goal[0]), int(goal[1]))
    if map2d.is_occupied(*start) or map2d.is_occupied(*goal):
        return []
    cost, came, closed = {start: 0.0}, {start: None}, set()
    queue = [(0.0, start)]
    while queue:
        _, here = heapq.heappop(queue)
        if here == goal:
            path = []
            while here is not None:
                path.append(here)
                here = came[here]
            return path[::-1]
        if here in closed:
            continue
        closed.add(here)
        for dx, dy, length in STEPS:
            there = (here[0] + dx * cell, here[1] + dy * cell)
            price = cost[here] + length * cell
            if price >= cost.get(there, math.inf):
                continue
            if not can_step(map2d, here, dx, dy, cell):
                continue
            cost[there], came[there] = price, here
            rest_x, rest_y = abs(goal[0] - there[0]), abs(goal[1] - there[1])
            rest = max(rest_x, rest_y) + 0.4142 * min(rest_x, rest_y)
            heapq.heappush(queue, (price + rest, there))
    return []


def can_step(map2d, here, dx, dy, cell):
    x, y = here
    for _ in range(cell):
        if map2d.is_occupied(x + dx, y + dy):
            return False
        if dx and dy and (map2d.is_occupied(x + dx, y) or map2d.is_occupied(x, y + dy)):
            return False
        x, y = x + dx, y + dy
    return True


def inflated(occ, radius):
    """The map grown by a disc: each pixel within `radius` of an obstacle or the rim."""
    reach = math.ceil(radius)
    padded = np.pad(occ, reach, constant_values=True)
    height, width = occ.shape
    grown = np.zeros_like(occ)
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            if dx * dx + dy * dy <= radius * radius:
                rows = slice(reach + dy, reach + dy + height)
                grown |= padded[rows, reach + dx : reach + dx + width]
    return grown


ROOM = OccMap2D(inflated(sensors.load_occupancy(MAP_IMG), RADIUS + MARGIN))
PATH = []


def reset(obs):
    """Plans from where the robot stands."""
    start = nearest_free(ROOM, float(obs["pose"][0]), float(obs["pose"][1]), 40)
    goal = nearest_free(ROOM, float(obs["goal"][0]), float(obs["goal"][1]), 40)
    PATH[:] = plan_path(ROOM, start, goal, 1)


def policy(obs):
    if not PATH:
        reset(obs)
    x, y, heading = map(float, obs["pose"])
    near = min(range(len(PATH)), key=lambda k: math.dist(PATH[k], (x, y)))
    ahead = near
    while ahead < len(PATH) - 1 and math.dist(PATH[ahead], (x, y)) < LOOKAHEAD:
        ahead += 1
    aim = PATH[ahead]
    if ahead == len(PATH) - 1:
        aim = (float(obs["goal"][0]), float(obs["goal"][1]))
    error = math.remainder(math.atan2(aim[1] - y, aim[0] - x) - heading, math.tau)
    front = float(np.min(obs["ranges"][N_RAYS // 3 : -N_RAYS // 3 or None]))
    speed = 0.7 if front > SLOW_DIST else 0.4 if front > STOP_DIST else 0.2
    if abs(error) > 0.8:
        speed = 0.0
    turn = max(-0.3, min(0.3, 0.8 * error))
    return speed + turn, speed - turn


def run_episode(env, max_steps):
    obs, _ = env.reset()
    reset(obs)
    positions = [(float(obs["pose"][0]), float(obs["pose"][1]))]
    speeds, collisions = [], 0
    for _ in range(max_steps):
        left, right = policy(obs)
        obs, _, terminated, truncated, info = env.step((left, right))
        positions.append((float(obs["pose"][0]), float(obs["pose"][1])))
        speeds.append((left + right) / 2 * MAX_SPEED)
        collisions = info["collisions"]
        if terminated or truncated:
            break
    goal = (float(obs["goal"][0]), float(obs["goal"][1]))
    return {
        "positions": positions,
        "speeds": speeds,
        "collisions": collisions,
        "goal": goal,
        "dt": DT,
    }


def main():
    sensors.show(policy, reset)


if __name__ == "__main__":
    main()
