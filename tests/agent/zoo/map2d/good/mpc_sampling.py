# idea: model predictive control by seeded sampling around the last best sequence
# profile: paper
"""Random shooting: 160 wheel-speed sequences, all rolled out at once with NumPy."""

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
LOOKAHEAD = 8  # steps that are foreseen
STOP_DIST = ROBOT["radius"] + 2.0
SLOW_DIST = ROBOT["radius"] + 5.0
SAMPLES = 160


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


STATE = {}


def reset(obs):
    """Way left to the goal, dearer near walls, for every pixel."""
    occ = sensors.load_occupancy(MAP_IMG)
    room = OccMap2D(inflated(occ, STOP_DIST))
    goal = nearest_free(room, float(obs["goal"][0]), float(obs["goal"][1]), 60)
    # Without a way: dear, and the dearer the nearer to a wall, so that it leads out.
    depth = sum(inflated(occ, reach) for reach in range(1, round(STOP_DIST) + 1))
    cost = 1500.0 + 300.0 * depth
    for (x, y), length in distances(room, goal, 1).items():
        cost[y, x] = length
    near_walls = inflated(occ, SLOW_DIST)
    STATE["cost"] = cost + 6.0 * near_walls
    STATE["plan"] = np.zeros((LOOKAHEAD, 2))
    STATE["random"] = np.random.default_rng(7)


def candidates():
    """Sequences (sample, step, wheel): the last plan, shifted, and noise around it."""
    random, plan = STATE["random"], np.roll(STATE["plan"], -1, axis=0)
    forward = random.choice([0.0, 0.3, 0.6], (SAMPLES, 1, 1))
    turn = random.normal(0.0, 0.22, (SAMPLES, 2, 1)).repeat(LOOKAHEAD // 2, axis=1)
    fresh = np.concatenate([forward + turn, forward - turn], axis=2)
    fresh[: SAMPLES // 3] = plan + random.normal(
        0.0, 0.08, (SAMPLES // 3, LOOKAHEAD, 2)
    )
    fresh[0] = plan
    return np.clip(fresh, -0.8, 0.8)


def roll_out(pose, wheels):
    """Positions and headings (sample, step) of all sequences."""
    turns = (wheels[..., 0] - wheels[..., 1]) * SPEED * DT / AXLE_LENGTH_PX
    headings = pose[2] + np.cumsum(turns, axis=1) - turns / 2
    ways = wheels.mean(axis=2) * SPEED * DT
    xs = pose[0] + np.cumsum(ways * np.cos(headings), axis=1)
    ys = pose[1] + np.cumsum(ways * np.sin(headings), axis=1)
    return xs, ys, headings[:, -1] + turns[:, -1] / 2


def look_up(xs, ys):
    cost = STATE["cost"]
    rows = np.clip(np.rint(ys).astype(int), 0, cost.shape[0] - 1)
    return cost[rows, np.clip(np.rint(xs).astype(int), 0, cost.shape[1] - 1)]


def policy(obs):
    if not STATE:
        reset(obs)
    pose, goal = obs["pose"].astype(float), obs["goal"].astype(float)
    sequences = candidates()
    xs, ys, headings = roll_out(pose, sequences)
    ahead_x, ahead_y = (
        xs[:, -1] + 7 * np.cos(headings),
        ys[:, -1] + 7 * np.sin(headings),
    )
    costs = look_up(xs, ys).sum(axis=1) / LOOKAHEAD + look_up(ahead_x, ahead_y)
    if np.hypot(*(goal - pose[:2])) < 15:
        costs = np.hypot(xs - goal[0], ys - goal[1]).sum(axis=1)
        costs += np.hypot(ahead_x - goal[0], ahead_y - goal[1])
        costs += 1e3 * (look_up(xs, ys) > 1400).any(axis=1)
    STATE["plan"] = sequences[int(np.argmin(costs))]
    left, right = STATE["plan"][0]
    return float(left), float(right)


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
