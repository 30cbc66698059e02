# idea: a planner, a follower and a pilot, each a class with one duty
# profile: paper
"""Planner, Follower and Pilot as classes; the module keeps the episode's pilot."""

import heapq
import math

import numpy as np
import sensors

MAP_IMG = "occupancy.npy"
PARAMS_JSON = "params.json"
ROBOT_IMG = "robot.png"

PARAMS = sensors.load_params(PARAMS_JSON)
AXLE_LENGTH_PX = PARAMS["robot"]["axle_length"]
SENSOR_RANGE_PX = PARAMS["robot"]["range_max"]
SENSOR_FOV_DEG = PARAMS["robot"]["field_of_view_deg"]
N_RAYS = PARAMS["robot"]["n_rays"]
LOOKAHEAD = 2.0 * PARAMS["robot"]["radius"]
STOP_DIST = 1.2 * PARAMS["robot"]["radius"]
SLOW_DIST = 2.5 * PARAMS["robot"]["radius"]


class OccMap2D:
    """Bool cells [y, x]; all outside is occupied."""

    def __init__(self, occ):
        self.occ = np.asarray(occ).astype(bool)

    @property
    def size(self):
        return self.occ.shape[1], self.occ.shape[0]

    def is_inside(self, x, y):
        width, height = self.size
        return 0 <= x < width and 0 <= y < height

    def is_occupied(self, x, y):
        return not self.is_inside(x, y) or bool(self.occ[y, x])

    def inflated(self, radius):
        """A map whose free pixels keep `radius` px from walls and rim."""
        reach = math.ceil(radius)
        occ = np.pad(self.occ, reach, constant_values=True)
        columns = np.arange(-reach, reach + 1)
        result = occ.copy()
        for dy in range(-reach, reach + 1):
            for dx in columns[columns**2 <= radius**2 - dy**2].tolist():
                result |= np.roll(occ, (dy, dx), axis=(0, 1))
        return OccMap2D(result[reach:-reach, reach:-reach])


class Planner:
    """A* with octile distances."""

    MOVES = ((1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (-1, -1), (1, -1))

    def __init__(self, map2d, cell):
        self.map, self.cell = map2d, cell

    def plan(self, start, goal):
        if self.map.is_occupied(*start) or self.map.is_occupied(*goal):
            return []
        self.parent, self.cost = {start: start}, {start: 0.0}
        queue, closed = [(0.0, start)], set()
        while queue:
            here = heapq.heappop(queue)[1]
            if here == goal:
                return self.back(goal)
            if here not in closed:
                closed.add(here)
                self.expand(here, goal, queue)
        return []

    def expand(self, here, goal, queue):
        for dx, dy in self.MOVES:
            there = self.walk(here, dx, dy)
            if there is None:
                continue
            cost = self.cost[here] + self.cell * math.hypot(dx, dy)
            if cost < self.cost.get(there, math.inf):
                self.cost[there], self.parent[there] = cost, here
                heapq.heappush(queue, (cost + math.dist(there, goal), there))

    def walk(self, here, dx, dy):
        x, y = here
        for _ in range(self.cell):
            beside = dx and dy
            if beside and (
                self.map.is_occupied(x + dx, y) or self.map.is_occupied(x, y + dy)
            ):
                return None
            x, y = x + dx, y + dy
            if self.map.is_occupied(x, y):
                return None
        return x, y

    def back(self, point):
        path = [point]
        while self.parent[path[-1]] != path[-1]:
            path.append(self.parent[path[-1]])
        return path[::-1]


class Follower:
    """Pure pursuit along a path, with progress that never goes back."""

    def __init__(self, path, goal):
        self.path, self.goal, self.at = path, goal, 0

    def aim(self, x, y):
        view = range(self.at, min(self.at + 30, len(self.path)))
        self.at = min(view, key=lambda k: math.dist(self.path[k], (x, y)))
        for point in self.path[self.at :]:
            if math.dist(point, (x, y)) >= LOOKAHEAD:
                return point
        return self.goal


class Pilot:
    """One episode."""

    def __init__(self, obs):
        self.goal = tuple(map(float, obs["goal"]))
        room = OccMap2D(sensors.load_occupancy(MAP_IMG))
        room = room.inflated(PARAMS["robot"]["radius"] + 3.0)
        start = nearest_free(room, *map(round, obs["pose"][:2].tolist()), 50)
        end = nearest_free(room, *map(round, self.goal), 50)
        self.follower = Follower(Planner(room, 1).plan(start, end), self.goal)

    def wheels(self, obs):
        x, y, heading = map(float, obs["pose"])
        aim_x, aim_y = self.follower.aim(x, y)
        error = math.remainder(math.atan2(aim_y - y, aim_x - x) - heading, math.tau)
        speed = self.speed(obs["ranges"]) if abs(error) < math.pi / 4 else 0.0
        turn = max(-0.35, min(0.35, 0.9 * error))
        return speed + turn, speed - turn

    def speed(self, ranges):
        ahead = float(min(ranges[N_RAYS // 3 : N_RAYS - N_RAYS // 3]))
        if ahead < STOP_DIST:
            return 0.15
        return 0.6 if ahead > SLOW_DIST else 0.35


def nearest_free(map2d, x, y, max_rad):
    if not map2d.is_occupied(x, y):
        return int(x), int(y)
    rows, columns = np.nonzero(~map2d.occ)
    squares = (rows - y) ** 2 + (columns - x) ** 2
    if not squares.size or squares.min() > max_rad**2:
        raise ValueError(f"no free pixel within {max_rad} px of ({x}, {y})")
    k = int(squares.argmin())
    return int(columns[k]), int(rows[k])


def plan_path(map2d, start, goal, cell):
    return Planner(map2d, cell).plan(tuple(start), tuple(goal))


PILOTS = []


def reset(obs):
    PILOTS[:] = [Pilot(obs)]


def policy(obs):
    if not PILOTS:
        reset(obs)
    return PILOTS[-1].wheels(obs)


class Log:
    """What `run_episode` returns, written step by step."""

    def __init__(self, obs):
        self.positions, self.speeds, self.collisions = [self.place(obs)], [], 0
        self.goal = tuple(map(float, obs["goal"]))

    @staticmethod
    def place(obs):
        return float(obs["pose"][0]), float(obs["pose"][1])

    def add(self, obs, wheels, info):
        self.positions.append(self.place(obs))
        self.speeds.append(sum(wheels) / 2 * PARAMS["robot"]["max_wheel_speed"])
        self.collisions = info["collisions"]

    def result(self):
        return {
            "positions": self.positions,
            "speeds": self.speeds,
            "collisions": self.collisions,
            "goal": self.goal,
            "dt": 0.05,
        }


def run_episode(env, max_steps):
    obs, _ = env.reset()
    reset(obs)
    log = Log(obs)
    for _ in range(max_steps):
        wheels = policy(obs)
        obs, _, terminated, truncated, info = env.step(wheels)
        log.add(obs, wheels, info)
        if terminated or truncated:
            break
    return log.result()


def main():
    sensors.show(policy, reset)


if __name__ == "__main__":
    main()
