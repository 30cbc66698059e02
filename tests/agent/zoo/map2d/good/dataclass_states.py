# idea: dataclasses for all state, and a state machine: turn, drive, approach
# profile: paper
"""Frozen settings, a mutable state, and one function for each mode of driving."""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass, field

import numpy as np
import sensors

MAP_IMG: str = "occupancy.npy"
PARAMS_JSON: str = "params.json"
ROBOT_IMG: str = "robot.png"


@dataclass(frozen=True)
class Settings:
    radius: float
    axle: float
    speed: float
    range_max: float
    fov: float
    rays: int
    dt: float = 0.05
    margin: float = 3.5

    @property
    def turn_step(self) -> float:
        """Largest turn in one step, rad."""
        return 2 * self.speed * self.dt / self.axle


def read_settings() -> Settings:
    robot = sensors.load_params(PARAMS_JSON)["robot"]
    names = ("radius", "axle_length", "max_wheel_speed", "range_max")
    return Settings(
        *(robot[name] for name in names), robot["field_of_view_deg"], robot["n_rays"]
    )


SETTINGS = read_settings()
AXLE_LENGTH_PX: float = SETTINGS.axle
SENSOR_RANGE_PX: float = SETTINGS.range_max
SENSOR_FOV_DEG: float = SETTINGS.fov
N_RAYS: int = SETTINGS.rays
LOOKAHEAD: float = 14.0
STOP_DIST: float = 1.0
SLOW_DIST: float = 10.0


@dataclass
class OccMap2D:
    occ: np.ndarray

    def __post_init__(self) -> None:
        self.occ = np.asarray(self.occ, dtype=bool)
        self.height, self.width = self.occ.shape

    def is_occupied(self, x: int, y: int) -> bool:
        if min(x, y) < 0 or x >= self.width or y >= self.height:
            return True
        return bool(self.occ[y, x])


@dataclass(order=True)
class Node:
    rank: float
    x: int = field(compare=False)
    y: int = field(compare=False)
    cost: float = field(compare=False)
    parent: Node | None = field(compare=False, default=None, repr=False)

    def path(self) -> list[tuple[int, int]]:
        points, node = [], self
        while node is not None:
            points.append((node.x, node.y))
            node = node.parent
        return points[::-1]


def nearest_free(map2d: OccMap2D, x: int, y: int, max_rad: float) -> tuple[int, int]:
    ring: list[tuple[float, int, int]] = []
    reach = math.floor(max_rad)
    for dy in range(-reach, reach + 1):
        width = math.floor(math.sqrt(max_rad**2 - dy**2))
        ring += [(math.hypot(dx, dy), dx, dy) for dx in range(-width, width + 1)]
    for _, dx, dy in sorted(ring):
        if not map2d.is_occupied(x + dx, y + dy):
            return int(x + dx), int(y + dy)
    raise ValueError(f"no free pixel within {max_rad} px")


def plan_path(map2d, start, goal, cell) -> list[tuple[int, int]]:
    (x, y), (gx, gy) = map(int, start), map(int, goal)
    if map2d.is_occupied(x, y) or map2d.is_occupied(gx, gy):
        return []
    queue, closed, best = [Node(0.0, x, y, 0.0)], set(), {(x, y): 0.0}
    while queue:
        node = heapq.heappop(queue)
        if (node.x, node.y) == (gx, gy):
            return node.path()
        if (node.x, node.y) in closed:
            continue
        closed.add((node.x, node.y))
        for dx in (-1, 0, 1):
            for dy in (-1, 0, 1):
                after = (node.x + dx * cell, node.y + dy * cell)
                cost = node.cost + math.hypot(dx, dy) * cell
                if after in closed or cost >= best.get(after, math.inf):
                    continue
                if is_open(map2d, node.x, node.y, dx, dy, cell):
                    best[after] = cost
                    rank = cost + math.hypot(after[0] - gx, after[1] - gy)
                    heapq.heappush(queue, Node(rank, *after, cost, node))
    return []


def is_open(map2d, x, y, dx, dy, cell) -> bool:
    for k in range(cell):
        a, b = x + k * dx, y + k * dy
        around = {(a + dx, b + dy), (a + dx, b), (a, b + dy)}
        if any(map2d.is_occupied(*p) for p in around - {(a, b)}):
            return False
    return True


@dataclass
class State:
    path: list[tuple[int, int]]
    goal: tuple[float, float]
    mode: str = "turn"
    index: int = 0


STATES: list[State] = []


def room_for_body() -> OccMap2D:
    occ = sensors.load_occupancy(MAP_IMG)
    reach = math.ceil(SETTINGS.radius + SETTINGS.margin)
    padded = np.pad(occ, reach, constant_values=True)
    result = np.zeros_like(occ)
    for dy, dx in np.ndindex(2 * reach + 1, 2 * reach + 1):
        if math.hypot(dy - reach, dx - reach) <= SETTINGS.radius + SETTINGS.margin:
            result |= padded[dy : dy + occ.shape[0], dx : dx + occ.shape[1]]
    return OccMap2D(result)


def reset(obs) -> None:
    room = room_for_body()
    x, y = (round(float(v)) for v in obs["pose"][:2])
    goal = (float(obs["goal"][0]), float(obs["goal"][1]))
    start = nearest_free(room, x, y, 60)
    end = nearest_free(room, round(goal[0]), round(goal[1]), 60)
    STATES[:] = [State(plan_path(room, start, end, 1), goal)]


def turn(state: State, error: float, far: float) -> tuple[float, float]:
    if abs(error) < 0.15:
        state.mode = "drive"
    spin = max(-0.7, min(0.7, error / SETTINGS.turn_step))
    return spin, -spin


def drive(state: State, error: float, far: float) -> tuple[float, float]:
    if abs(error) > 0.7:
        state.mode = "turn"
    elif state.index == len(state.path) - 1:
        state.mode = "approach"
    spin = max(-0.3, min(0.3, 0.5 * error / SETTINGS.turn_step))
    return 0.65 + spin, 0.65 - spin


def approach(state: State, error: float, far: float) -> tuple[float, float]:
    if abs(error) > 0.3:
        return turn(state, error, far)
    speed = 0.4 * min(1.0, max(far, STOP_DIST) / SLOW_DIST)
    return speed + 0.2 * error, speed - 0.2 * error


MODES = {"turn": turn, "drive": drive, "approach": approach}


def policy(obs) -> tuple[float, float]:
    if not STATES:
        reset(obs)
    state = STATES[0]
    x, y, heading = (float(v) for v in obs["pose"])
    last = len(state.path) - 1
    while state.index < last and math.dist(state.path[state.index], (x, y)) < LOOKAHEAD:
        state.index += 1
    aim = state.goal if state.index == last else state.path[state.index]
    error = math.remainder(math.atan2(aim[1] - y, aim[0] - x) - heading, math.tau)
    return MODES[state.mode](state, error, math.dist(aim, (x, y)))


@dataclass
class Record:
    positions: list[tuple[float, float]] = field(default_factory=list)
    speeds: list[float] = field(default_factory=list)
    collisions: int = 0
    goal: tuple[float, float] = (0.0, 0.0)
    dt: float = SETTINGS.dt

    def see(self, obs) -> None:
        self.positions.append((float(obs["pose"][0]), float(obs["pose"][1])))
        self.goal = (float(obs["goal"][0]), float(obs["goal"][1]))


def run_episode(env, max_steps):
    record = Record()
    obs, _ = env.reset()
    reset(obs)
    record.see(obs)
    for _ in range(max_steps):
        wheels = policy(obs)
        obs, _, terminated, truncated, info = env.step(wheels)
        record.see(obs)
        record.speeds.append(sum(wheels) / 2 * SETTINGS.speed)
        record.collisions = info["collisions"]
        if terminated or truncated:
            break
    names = ("positions", "speeds", "collisions", "goal", "dt")
    return {name: getattr(record, name) for name in names}


def main():
    sensors.show(policy, reset)


if __name__ == "__main__":
    main()
