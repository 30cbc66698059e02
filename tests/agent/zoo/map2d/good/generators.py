# idea: the driver is a generator: observations are sent in, wheel speeds come out
# profile: paper
"""Coroutines: `driver` goes from leg to leg, `go_to` is one leg of its own."""

import collections
import itertools
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
LOOKAHEAD = 9
STOP_DIST = 4
SLOW_DIST = 10


class OccMap2D:
    def __init__(self, occ):
        occ = np.asarray(occ, bool)
        self.free = {(int(x), int(y)) for y, x in np.argwhere(~occ)}

    def is_occupied(self, x, y):
        return (x, y) not in self.free


def nearest_free(map2d, x, y, max_rad):
    point = min(map2d.free, key=lambda p: math.dist(p, (x, y)), default=None)
    if point is None or math.dist(point, (x, y)) > max_rad:
        raise ValueError("too far from everything free")
    return point


def moves(map2d, x, y, cell):
    """Free steps of `cell` px, straight ones first."""
    for dx, dy in sorted(
        itertools.product((-1, 0, 1), repeat=2), key=lambda d: abs(d[0] * d[1])
    ):
        line = [(x + k * dx, y + k * dy) for k in range(cell)]
        if (dx or dy) and all(
            {(a + dx, b + dy), (a + dx, b), (a, b + dy)} <= map2d.free for a, b in line
        ):
            yield x + cell * dx, y + cell * dy


def plan_path(map2d, start, goal, cell):
    """Dijkstra's search with buckets instead of a heap: tenths of a pixel as keys."""
    start, goal = (int(start[0]), int(start[1])), (int(goal[0]), int(goal[1]))
    if not {start, goal} <= map2d.free:
        return []
    before, cost = {start: None}, {start: 0}
    buckets = collections.defaultdict(
        collections.deque, {0: collections.deque([start])}
    )
    straight, diagonal = 100 * cell, 141 * cell
    now = -1
    while buckets:
        now += 1
        for here in iter_bucket(buckets, now):
            if cost[here] < now:
                continue
            if here == goal:
                return list(back(before, goal))[::-1]
            for there in moves(map2d, *here, cell):
                is_straight = here[0] == there[0] or here[1] == there[1]
                after = now + (straight if is_straight else diagonal)
                if after < cost.get(there, math.inf):
                    cost[there], before[there] = after, here
                    buckets[after].append(there)
    return []


def iter_bucket(buckets, key):
    """Everything in a bucket, which is then removed."""
    while buckets.get(key):
        yield buckets[key].popleft()
    buckets.pop(key, None)


def back(before, point):
    while point is not None:
        yield point
        point = before[point]


def shrunk(occ, radius):
    """A map of what keeps `radius` px from walls and rim."""
    reach = math.ceil(radius)
    padded = np.pad(occ, reach, constant_values=True)
    views = (
        padded[
            reach + dy : reach + dy + occ.shape[0],
            reach + dx : reach + dx + occ.shape[1],
        ]
        for dy, dx in itertools.product(range(-reach, reach + 1), repeat=2)
        if math.hypot(dy, dx) <= radius
    )
    return OccMap2D(np.logical_or.reduce(list(views)))


def go_to(obs, aim, tolerance):
    """Yields wheel speeds until `aim` is near; returns the last observation."""
    while True:
        x, y, heading = obs["pose"].tolist()
        far = math.dist((x, y), aim)
        if far < tolerance:
            return obs
        error = math.remainder(math.atan2(aim[1] - y, aim[0] - x) - heading, math.tau)
        speed = 0.6 * min(1.0, far / SLOW_DIST + 0.3) * max(0.0, math.cos(1.5 * error))
        if abs(error) > 0.8:
            speed = 0.0
        spin = max(-0.35, min(0.35, 0.9 * error))
        obs = yield speed + spin, speed - spin


def driver(obs):
    """The whole episode."""
    room = shrunk(sensors.load_occupancy(MAP_IMG), ROBOT["radius"] + 3)
    goal = obs["goal"].tolist()
    ends = (nearest_free(room, *p, 99) for p in (obs["pose"][:2].tolist(), goal))
    for aim in plan_path(room, *ends, 1)[LOOKAHEAD::LOOKAHEAD]:
        obs = yield from go_to(obs, aim, STOP_DIST)
    while True:
        obs = yield from go_to(obs, goal, 0.5)
        obs = yield 0.0, 0.0


DRIVERS = []


def policy(obs):
    if not DRIVERS:
        DRIVERS.append(driver(obs))
        return next(DRIVERS[0])
    return DRIVERS[0].send(obs)


def reset(obs):
    DRIVERS.clear()


def episode(env, max_steps):
    """Yields observation, wheel speeds and info of each step."""
    obs, _ = env.reset()
    reset(obs)
    yield obs, None, {"collisions": 0}
    for _ in range(max_steps):
        wheels = policy(obs)
        obs, _, terminated, truncated, info = env.step(wheels)
        yield obs, wheels, info
        if terminated or truncated:
            return


def run_episode(env, max_steps):
    seen, wheels, infos = zip(*episode(env, max_steps), strict=True)
    return {
        "positions": [tuple(obs["pose"][:2].tolist()) for obs in seen],
        "speeds": [(a + b) / 2 * ROBOT["max_wheel_speed"] for a, b in wheels[1:]],
        "collisions": infos[-1]["collisions"],
        "goal": tuple(seen[0]["goal"].tolist()),
        "dt": 0.05,
    }


def main():
    sensors.show(policy, reset)


if __name__ == "__main__":
    main()
